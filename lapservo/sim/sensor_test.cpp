#include "lapservo/sim/sensor.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/sim/optics.h"
#include "lapservo/sim/test_edge_probe.h"

namespace lapservo::internal::sensor_test {

struct Spread {
  double mean, variance;
};

Spread spread_of(const cv::Mat& light) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(light, mean, deviation);
  return {(mean[0] + mean[1] + mean[2]) / 3,
          (deviation[0] * deviation[0] + deviation[1] * deviation[1] + deviation[2] * deviation[2]) / 3};
}

cv::Mat exposed(const Response& response, const Sensor& sensor, float light, std::uint64_t seed) {
  SensorEncoder encoder(response, sensor);
  auto encoded = encoder.allocate({200, 150});
  const std::vector<float> row(600, light);
  for (int v = 0; v < 150; ++v) encoder.encode(row.data(), 200, v, 0, encoded);
  return encoder.expose(encoded, seed);
}

TEST(Sensor, NoiseInLinearLightIsReadPlusShotNoise) {
  const Sensor sensor;
  for (const Response& response :
       {Response{}, Response{Response::Kind::power, 1}, Response{Response::Kind::power, 2.2}})
    for (const float light : {0.1F, 0.3F, 0.6F, 0.85F}) {
      const Spread spread = spread_of(light_of(exposed(response, sensor, light, 1), response));
      const double level = response.light_from_value(response.value_from_light(light) + 1.0 / 255) - light;
      const double expected = sensor.read_noise * sensor.read_noise + sensor.shot_noise * light + level * level / 12;
      EXPECT_NEAR(spread.mean, light, 0.05 * level + 1e-4) << response.gamma << ' ' << light;
      EXPECT_NEAR(spread.variance / expected, 1, 0.06) << response.gamma << ' ' << light;
    }
}

TEST(Sensor, NoiseIsIndependentOfItsNeighboursAndOfTheFrameBefore) {
  const Response linear{Response::Kind::power, 1};
  Sensor sensor;
  sensor.read_noise = 0.02;
  const auto noise = [&](std::uint64_t seed) {
    cv::Mat values;
    exposed(linear, sensor, 0.5F, seed).convertTo(values, CV_32FC3, 1.0 / 255, -0.5);
    return values;
  };
  const cv::Mat a = noise(1), b = noise(2);
  const double power = a.dot(a), count = 3.0 * static_cast<double>(a.total());
  const double limit = 5 / std::sqrt(count);
  EXPECT_LT(std::abs(a.dot(b)) / power, limit);
  EXPECT_LT(std::abs(a.colRange(1, 200).dot(a.colRange(0, 199))) / power, limit);
  EXPECT_LT(std::abs(a.rowRange(1, 150).dot(a.rowRange(0, 149))) / power, limit);
}

// The second moment of a blurred step's slope is the blur's variance.
TEST(Optics, BlurHasTheWidthThatWasAskedFor) {
  for (const double blur_px : {0.8, 2.2, 5.0})
    for (const bool upright : {false, true}) {
      cv::Mat light(80, 80, CV_32FC3, cv::Scalar::all(0));
      (upright ? light.colRange(40, 80) : light.rowRange(40, 80)).setTo(cv::Scalar::all(1));
      Optics optics(blur_px);
      std::vector<double> profile;
      for (int i = 0; i < 80; ++i)
        profile.push_back(upright ? optics.row(light, 40, 0, 80)[3 * i] : optics.row(light, i, 30, 50)[30]);
      double total = 0, mean = 0, square = 0;
      for (int i = 1; i < 80; ++i) {
        const double slope = profile[static_cast<std::size_t>(i)] - profile[static_cast<std::size_t>(i - 1)];
        total += slope;
        mean += slope * (i - 0.5);
        square += slope * (i - 0.5) * (i - 0.5);
      }
      EXPECT_NEAR(total, 1, 1e-4);
      EXPECT_NEAR(mean, 39.5, 1e-3);
      EXPECT_NEAR(std::sqrt(square - mean * mean), blur_px, 0.03 * blur_px);
    }
}

}  // namespace lapservo::internal::sensor_test
