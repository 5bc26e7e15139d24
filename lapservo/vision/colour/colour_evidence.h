#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace lapservo::internal {

/// Where a marker in a pose has a pixel: amid one of its bands, on the bare shaft beyond an end, beside the shaft.
enum class Place : std::uint8_t { band, shaft, beside };
/// The pixel's colour: that of the band which belongs there, that of another of the marker's bands, as grey as bare
/// shaft, another (blood, tissue).
enum class Shows : std::uint8_t { its_band, another_band, grey, other };

/// For a pixel without the marker's colours.
inline Shows grey_or_other(const std::uint8_t* bgr) {
  constexpr int dark = 20;  // there noise makes any colour
  constexpr double least_saturation = 0.35;
  const int b = bgr[0], g = bgr[1], r = bgr[2];
  const int most = std::max(std::max(b, g), r), least = std::min(std::min(b, g), r);
  return most < dark || most - least < least_saturation * most ? Shows::grey : Shows::other;
}

/// All that is none of the others is `other`.
constexpr std::array<double, 4> frequencies(double its_band, double another_band, double grey) {
  return {its_band, another_band, grey, 1 - (grey + another_band + its_band)};
}
/// How often pixels show what, by place: `accuracy_study colours 900 71`, frames in which blood hides 5 to 60 % of the
/// marker. On the shaft and beside it no band belongs there: any of the three is a third of what has their colours.
inline constexpr std::array colour_frequencies{
    frequencies(0.682, 0.016, 0.050),  // band
    frequencies(0.014, 0.027, 0.625),  // shaft
    frequencies(0.011, 0.022, 0.129),  // beside
};

/// Evidence for a pose by a pixel: the logarithm of how much more often it shows that in its place than anywhere in a
/// marker and beside it, in units of that of a band's own colour.
class ColourEvidence {
 public:
  ColourEvidence() {
    std::array<double, 4> anywhere{};
    for (const auto& shown : colour_frequencies)
      for (std::size_t i = 0; i < anywhere.size(); ++i) anywhere[i] += shown[i] / 3;
    anywhere[0] = (anywhere[0] + anywhere[1]) / 3, anywhere[1] = 2 * anywhere[0];
    const double unit = std::log(colour_frequencies[0][0] / anywhere[0]);
    for (std::size_t place = 0; place < of_.size(); ++place) {
      const auto& shown = colour_frequencies[place];
      for (std::size_t i = 0; i < anywhere.size(); ++i) of_[place][i] = std::log(shown[i] / anywhere[i]) / unit;
      none_[place] = std::log((shown[2] + shown[3]) / (anywhere[2] + anywhere[3])) / unit;
    }
  }

  double of(Place place, Shows shows) const {
    return of_[static_cast<std::size_t>(place)][static_cast<std::size_t>(shows)];
  }
  /// Grey and other together.
  double of_none(Place place) const { return none_[static_cast<std::size_t>(place)]; }

 private:
  std::array<std::array<double, 4>, 3> of_{};
  std::array<double, 3> none_{};
};
inline const ColourEvidence colour_evidence;

/// Gain of a pixel of a section across the shaft: evidence for a band against what is beside the shaft.
inline double section_gain(bool is_ours) {
  static const double unit =
      colour_evidence.of(Place::band, Shows::its_band) - colour_evidence.of(Place::beside, Shows::its_band);
  static const double none = (colour_evidence.of_none(Place::band) - colour_evidence.of_none(Place::beside)) / unit;
  return is_ours ? 1 : none;
}

}  // namespace lapservo::internal
