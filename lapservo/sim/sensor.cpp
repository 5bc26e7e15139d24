#include "lapservo/sim/sensor.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "lapservo/core/random.h"

namespace lapservo {
namespace {

constexpr int value_unit = 64, deviate_unit = 1024;
constexpr std::size_t deviate_count = std::size_t{1} << 17;
constexpr std::uint64_t deviate_seed = 20240229;

}  // namespace

SensorEncoder::SensorEncoder(const Response& response, const Sensor& sensor) : gains_(sensor.gains) {
  value_.resize(levels + 1);
  sigma_.resize(levels + 1);
  for (int i = 0; i <= levels; ++i) {
    // Squared spacing: the response is steep near black.
    const double light = std::pow(static_cast<double>(i) / levels, 2);
    const double noise = std::sqrt(sensor.read_noise * sensor.read_noise + sensor.shot_noise * light);
    // The response's mean slope over the noise's width, as its slope at black would exaggerate.
    const double slope = (response.value_from_light(std::min(1.0, light + noise)) -
                          response.value_from_light(std::max(0.0, light - noise))) /
                         (std::min(1.0, light + noise) - std::max(0.0, light - noise));
    value_[static_cast<std::size_t>(i)] =
        static_cast<std::int16_t>(std::lround(255 * value_unit * response.value_from_light(light)));
    sigma_[static_cast<std::size_t>(i)] =
        static_cast<std::int16_t>(std::min(4000L, std::lround(255 * value_unit * slope * noise)));
  }
  Random random(deviate_seed);
  deviates_.resize(deviate_count);
  for (auto& deviate : deviates_)
    deviate = static_cast<std::int16_t>(std::clamp(std::lround(random.normal() * deviate_unit), -8000L, 8000L));
}

void SensorEncoder::encode(const cv::Mat& light, cv::Mat value, cv::Mat sigma) const {
  for (int v = 0; v < light.rows; ++v) {
    const float* in = light.ptr<float>(v);
    std::int16_t* value_row = value.ptr<std::int16_t>(v);
    std::int16_t* sigma_row = sigma.ptr<std::int16_t>(v);
    for (int i = 0; i < 3 * light.cols; ++i) {
      const float exposed = std::clamp(in[i] * gains_[i % 3], 0.0F, 1.0F);
      const auto level = static_cast<std::size_t>(std::sqrt(exposed) * levels + 0.5F);
      value_row[i] = value_[level];
      sigma_row[i] = sigma_[level];
    }
  }
}

void SensorEncoder::expose(const Encoded& encoded, std::uint64_t seed, cv::Mat& image) const {
  image.create(encoded.value.size(), CV_8UC3);
  Random random(seed);
  const int count = 3 * encoded.value.cols;
  const std::size_t room = deviates_.size() - static_cast<std::size_t>(std::min<std::size_t>(
                                                  deviates_.size() - 1, static_cast<std::size_t>(count)));
  for (int v = 0; v < image.rows; ++v) {
    const std::int16_t* __restrict value = encoded.value.ptr<std::int16_t>(v);
    const std::int16_t* __restrict sigma = encoded.sigma.ptr<std::int16_t>(v);
    const std::int16_t* __restrict deviate = deviates_.data() + random.bits() % room;
    std::uint8_t* __restrict out = image.ptr<std::uint8_t>(v);
    for (int i = 0; i < count; ++i) {
      const int noisy = value[i] + (sigma[i] * deviate[i]) / deviate_unit + value_unit / 2;
      out[i] = static_cast<std::uint8_t>(std::clamp(noisy / value_unit, 0, 255));
    }
  }
}

}  // namespace lapservo
