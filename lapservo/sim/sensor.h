#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/geometry/response.h"
#include "lapservo/sim/scene.h"

namespace lapservo {

/// Turns linear light into encoded 8-bit pixels with noise. The noise is drawn from a table of normal deviates, read
/// from a fresh place for every row of every frame; it is added to the encoded value with the slope of the response
/// there.
class SensorEncoder {
 public:
  SensorEncoder(const Response& response, const Sensor& sensor);

  /// Encoded value and its noise's sigma, as fixed-point numbers with 6 bits after the point (CV_16SC3 each).
  struct Encoded {
    cv::Mat value, sigma;
  };
  Encoded allocate(cv::Size size) const { return {cv::Mat(size, CV_16SC3), cv::Mat(size, CV_16SC3)}; }
  /// Encodes a part: `light` CV_32FC3; writes to the same-sized parts `value` and `sigma`.
  void encode(const cv::Mat& light, cv::Mat value, cv::Mat sigma) const;
  /// Adds noise and rounds to 8 bits.
  void expose(const Encoded& encoded, std::uint64_t seed, cv::Mat& image) const;

 private:
  static constexpr int levels = 8192;
  std::vector<std::int16_t> value_, sigma_;  // by light
  std::vector<std::int16_t> deviates_;       // of sigma 1024
  Light gains_;
};

}  // namespace lapservo
