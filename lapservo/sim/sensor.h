#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/geometry/response.h"
#include "lapservo/sim/scene.h"

namespace lapservo::internal {

/// Turns linear light into encoded 8-bit pixels with noise. The noise is drawn from a table of normal deviates (cut at
/// four sigma), read from a fresh place for every row of every frame; it is added to the encoded value with the slope
/// of the response there.
class SensorEncoder {
 public:
  SensorEncoder(const Response& response, const Sensor& sensor);

  void set_gains(const Light& gains);

  /// Encoded values in 64ths and the noise's sigma in 512ths (CV_16SC3 each), before noise and rounding.
  struct Encoded {
    cv::Mat value, sigma;
  };
  Encoded allocate(cv::Size size) const { return {cv::Mat(size, CV_16SC3), cv::Mat(size, CV_16SC3)}; }
  /// Encodes pixels of `light` (three floats each) to row v of `encoded`, from column `begin` on.
  void encode(const float* light, int pixels, int v, int begin, Encoded& encoded);
  /// Adds noise and rounds to 8 bits.
  cv::Mat expose(const Encoded& encoded, std::uint64_t seed) const;

 private:
  static constexpr int levels = 8192;
  struct Level {
    std::int16_t value, sigma;
  };
  std::vector<Level> by_level_;
  std::array<float, 12> gains_;  // of four pixels
  std::vector<std::int32_t> row_;
};

}  // namespace lapservo::internal
