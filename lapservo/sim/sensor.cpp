#include "lapservo/sim/sensor.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <opencv2/core/hal/intrin.hpp>

#include "lapservo/core/random.h"

namespace lapservo::internal {
namespace {

constexpr int value_unit = 64, sigma_unit = 512, deviate_unit = 8192;
constexpr int value_bits = 6;
static_assert((1 << value_bits) == value_unit && sigma_unit * deviate_unit == value_unit * (1 << 16));
constexpr std::size_t deviate_count = std::size_t{1} << 17;
constexpr std::uint64_t deviate_seed = 20240229;
constexpr double most = 32767;

// Deviates of sigma `deviate_unit`, shared by all sensors: making them takes as long as an image.
const std::vector<std::int16_t>& normal_deviates() {
  static const std::vector<std::int16_t> all = [] {
    Random random(deviate_seed);
    std::vector<std::int16_t> deviates(deviate_count);
    for (auto& deviate : deviates)
      deviate = static_cast<std::int16_t>(std::lround(std::clamp(random.normal() * deviate_unit, -most, most)));
    return deviates;
  }();
  return all;
}

}  // namespace

SensorEncoder::SensorEncoder(const Response& response, const Sensor& sensor) {
  set_gains(sensor.gains);
  for (int i = 0; i <= levels; ++i) {
    // Squared spacing: the response is steep near black.
    const double light = std::pow(static_cast<double>(i) / levels, 2);
    const double noise = std::sqrt(sensor.read_noise * sensor.read_noise + sensor.shot_noise * light);
    // The response's mean slope over the noise's width, as its slope at black would exaggerate.
    const double low = std::max(0.0, light - noise), high = std::min(1.0, light + noise);
    const double slope =
        high > low ? (response.value_from_light(high) - response.value_from_light(low)) / (high - low) : 0;
    by_level_.push_back({static_cast<std::int16_t>(std::lround(255 * value_unit * response.value_from_light(light))),
                         static_cast<std::int16_t>(std::lround(std::min(most, 255 * sigma_unit * slope * noise)))});
  }
}

void SensorEncoder::set_gains(const Light& gains) {
  for (std::size_t i = 0; i < gains_.size(); ++i) gains_[i] = gains[static_cast<Eigen::Index>(i % 3)];
}

void SensorEncoder::encode(const float* light, int pixels, int v, int begin, Encoded& encoded) {
  const int count = 3 * pixels;
  row_.resize(static_cast<std::size_t>(count) + gains_.size());
  std::int32_t* __restrict level = row_.data();
  const auto level_of = [](float exposed) {
    return static_cast<std::int32_t>(std::sqrt(std::clamp(exposed, 0.0F, 1.0F)) * levels + 0.5F);
  };
  int i = 0;
  for (; i + 12 <= count; i += 12)
    for (int k = 0; k < 12; ++k) level[i + k] = level_of(light[i + k] * gains_[static_cast<std::size_t>(k)]);
  for (; i < count; ++i) level[i] = level_of(light[i] * gains_[static_cast<std::size_t>(i % 3)]);
  std::int16_t* value = encoded.value.ptr<std::int16_t>(v, begin);
  std::int16_t* sigma = encoded.sigma.ptr<std::int16_t>(v, begin);
  for (i = 0; i < count; ++i) {
    const Level at = by_level_[static_cast<std::size_t>(level[i])];
    value[i] = at.value;
    sigma[i] = at.sigma;
  }
}

cv::Mat SensorEncoder::expose(const Encoded& encoded, std::uint64_t seed) const {
  cv::Mat image(encoded.value.size(), CV_8UC3);
  Random random(seed);
  const std::size_t count = 3 * static_cast<std::size_t>(image.cols);
  const std::vector<std::int16_t>& deviates = normal_deviates();
  const std::size_t room = deviates.size() - std::min(deviates.size() - 1, count);
  const cv::v_int16x8 half = cv::v_setall_s16(value_unit / 2);
  for (int v = 0; v < image.rows; ++v) {
    const std::int16_t* value = encoded.value.ptr<std::int16_t>(v);
    const std::int16_t* sigma = encoded.sigma.ptr<std::int16_t>(v);
    const std::int16_t* deviate = deviates.data() + random.bits() % room;
    std::uint8_t* out = image.ptr<std::uint8_t>(v);
    std::size_t i = 0;
    const auto noisy = [&](std::size_t at) {
      return (cv::v_load(value + at) + cv::v_mul_hi(cv::v_load(sigma + at), cv::v_load(deviate + at)) + half) >>
             value_bits;
    };
    for (; i + 16 <= count; i += 16) cv::v_store(out + i, cv::v_pack_u(noisy(i), noisy(i + 8)));
    for (; i < count; ++i) {
      const int sum = value[i] + (sigma[i] * deviate[i] >> 16) + value_unit / 2;
      out[i] = static_cast<std::uint8_t>(std::clamp(sum >> value_bits, 0, 255));
    }
  }
  return image;
}

}  // namespace lapservo::internal
