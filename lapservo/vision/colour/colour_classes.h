#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// Which pixels have a colour. Hues of the samples' tissue: red to yellow, vessels violet.
struct ColourLimits {
  double merge_deg = 20;         ///< hues this close are one colour to the camera
  double widest_reach_deg = 34;  ///< no hue reaches further, else tissue and vessels have the marker's colours
  double min_saturation = 0.18;  ///< smoke (--smoke 0.55) leaves a quarter of the print's
  double min_chroma = 22;        ///< of 255: below it noise makes hues, most of all in the dark
};
inline constexpr ColourLimits colour_limits;

/// HSV hue of encoded values, degrees in (-60, 300], or nullopt for what is too grey or too dark to have one.
std::optional<double> hue_deg_of(double b, double g, double r);

/// Which of the markers' colours a pixel has: 0 for none, else 1, 2, ... for the rig's distinct hues. A pixel has a
/// colour when it is colourful and its HSV hue lies nearer to one of its hues than half the way to another colour's, so
/// that exposure, shading and moderate white balance need no tuning. Looked up by the high bits of each channel.
class ColourClasses {
 public:
  explicit ColourClasses(const std::vector<Instrument>& instruments);

  std::uint8_t operator()(const std::uint8_t* bgr) const { return table_[index(bgr)]; }
  /// For pixels that lie `step_bytes` apart, as many as `classes` has places.
  void classify(const std::uint8_t* bgr, std::ptrdiff_t step_bytes, std::span<std::uint8_t> classes) const {
    const std::uint8_t* table = table_.data();  // a local: bytes written could be anything's
    for (std::uint8_t& out : classes) out = table[index(bgr)], bgr += step_bytes;
  }
  /// Those of an instrument's three bands.
  const std::array<std::uint8_t, 3>& of_bands(std::size_t instrument) const { return bands_[instrument]; }
  int count() const { return count_; }

 private:
  static constexpr int bits = 5, shift = 8 - bits;
  static std::size_t index(const std::uint8_t* bgr) {
    return static_cast<std::size_t>((bgr[0] >> shift) << 2 * bits | (bgr[1] >> shift) << bits | (bgr[2] >> shift));
  }

  int count_ = 0;
  std::vector<std::array<std::uint8_t, 3>> bands_;
  std::vector<std::uint8_t> table_;
};

}  // namespace lapservo::internal
