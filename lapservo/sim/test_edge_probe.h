#pragma once

#include <cmath>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "lapservo/geometry/response.h"
#include "lapservo/sim/scene.h"

namespace lapservo::internal {

// For tests: measures images without any of the vision code.

/// Linear light of an 8-bit image, CV_32FC3.
inline cv::Mat light_of(const cv::Mat& bgr, const Response& response) {
  const auto table = response.table();
  cv::Mat light(bgr.size(), CV_32FC3);
  for (int v = 0; v < bgr.rows; ++v)
    for (int u = 0; u < bgr.cols; ++u)
      for (int c = 0; c < 3; ++c) light.at<cv::Vec3f>(v, u)[c] = table[bgr.at<cv::Vec3b>(v, u)[c]];
  return light;
}

/// Bilinear.
inline Light light_at(const cv::Mat& light, const Eigen::Vector2d& px) {
  const int u = static_cast<int>(std::floor(px.x())), v = static_cast<int>(std::floor(px.y()));
  const auto fu = static_cast<float>(px.x() - u), fv = static_cast<float>(px.y() - v);
  const auto at = [&](int y, int x) {
    const auto& pixel = light.at<cv::Vec3f>(y, x);
    return Light(pixel[0], pixel[1], pixel[2]);
  };
  return (1 - fv) * ((1 - fu) * at(v, u) + fu * at(v, u + 1)) + fv * ((1 - fu) * at(v + 1, u) + fu * at(v + 1, u + 1));
}

/// The place along `direction` (a unit vector), from `px`, where light is half way between that 4 to 6 px before and
/// that 4 to 6 px beyond, averaged over 6 px across; nullopt without contrast. The light's slope on both sides moves it
/// by some hundredths of a pixel, in any two images of the same scene alike.
inline std::optional<double> crossing_px(const cv::Mat& light, const Eigen::Vector2d& px,
                                         const Eigen::Vector2d& direction) {
  constexpr double step_px = 0.25, reach_px = 6, plateau_px = 4;
  const Eigen::Vector2d across(-direction.y(), direction.x());
  std::vector<Light> profile;
  Light before = Light::Zero(), beyond = Light::Zero();
  float count = 0;
  for (double t = -reach_px; t <= reach_px; t += step_px) {
    Light sum = Light::Zero();
    for (double side = -3; side <= 3; side += 0.5) sum += light_at(light, px + t * direction + side * across) / 13;
    profile.push_back(sum);
    if (t <= -plateau_px) before += sum, ++count;
    if (t >= plateau_px) beyond += sum;
  }
  const Light low = before / count, contrast = (beyond - before) / count;
  if (contrast.norm() < 0.02F) return std::nullopt;
  std::optional<double> nearest;
  for (std::size_t i = 0; i + 1 < profile.size(); ++i) {
    const float a = (profile[i] - low).dot(contrast) / contrast.squaredNorm() - 0.5F;
    const float b = (profile[i + 1] - low).dot(contrast) / contrast.squaredNorm() - 0.5F;
    if (a >= 0 || b < 0) continue;
    const double at_px = -reach_px + step_px * (static_cast<double>(i) + a / (a - b));
    if (!nearest || std::abs(at_px) < std::abs(*nearest)) nearest = at_px;
  }
  return nearest;
}

}  // namespace lapservo::internal
