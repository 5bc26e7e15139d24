#include "lapservo/sim/boards.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"

namespace lapservo::internal {
namespace {

constexpr int step_px = 4;  // between places that are computed; a lens bends little in between

// Where rays meet the board, in squares from its upper left corner, as two channels: of every fourth pixel.
cv::Mat places_on_board(const BoardScene& scene, const Camera& camera, const Rigid3& camera_from_board,
                        double magnification) {
  const Rigid3 board_from_camera = camera_from_board.inverse();
  const Eigen::Vector2d centre(camera.cx_px, camera.cy_px);
  cv::Mat places(camera.height_px / step_px + 2, camera.width_px / step_px + 2, CV_64FC2);
  for (int v = 0; v < places.rows; ++v)
    for (int u = 0; u < places.cols; ++u) {
      const Eigen::Vector2d raw(step_px * u, step_px * v), green = centre + (raw - centre) / magnification;
      const auto ideal = camera.ideal_from_raw(green);
      cv::Vec2d& place = places.at<cv::Vec2d>(v, u);
      place = {-100, -100};
      if (!ideal) continue;
      const Eigen::Vector3d ray = board_from_camera.rotation * camera.ray_from_ideal(*ideal);
      const Eigen::Vector3d eye = board_from_camera.translation;
      const Eigen::Vector3d point = eye - ray * (eye.z() / ray.z());
      place = {point.x() / scene.square_m + 1, point.y() / scene.square_m + 1};
    }
  return places;
}

double rise(double x) {
  return 0.5 * std::erfc(-x / std::numbers::sqrt2);
}

// Light of the pattern (0 dark, 1 bright): distances to the nearest lines, blurred.
double brightness(const BoardScene& scene, const cv::Vec2d& place, const cv::Vec2d& gradients) {
  double product = 1, inside = 1;
  const std::array<int, 2> squares{scene.columns + 1, scene.rows + 1};
  for (int i = 0; i < 2; ++i) {
    const double per_blur = 1 / (gradients[i] * scene.blur_px);
    const double line = std::round(place[i]), beyond = (place[i] - line) * per_blur;
    product *= (static_cast<long>(line) % 2 == 0 ? 1 : -1) * (2 * rise(beyond) - 1);
    inside *= rise(place[i] * per_blur) * rise((squares[static_cast<std::size_t>(i)] - place[i]) * per_blur);
  }
  return 1 - inside * 0.5 * (1 + product);
}

// Light of the pattern in each pixel, 0 to 1.
cv::Mat pattern(const BoardScene& scene, const Camera& camera, const cv::Mat& places) {
  cv::Mat light(camera.height_px, camera.width_px, CV_64F);
  for (int v = 0; v < light.rows; ++v)
    for (int u = 0; u < light.cols; ++u) {
      const int i = u / step_px, k = v / step_px;
      const double right = static_cast<double>(u % step_px) / step_px,
                   down = static_cast<double>(v % step_px) / step_px;
      const auto at = [&](int row, int column) { return places.at<cv::Vec2d>(row, column); };
      const cv::Vec2d top = (1 - right) * at(k, i) + right * at(k, i + 1);
      const cv::Vec2d bottom = (1 - right) * at(k + 1, i) + right * at(k + 1, i + 1);
      const cv::Vec2d by_v = (bottom - top) / step_px;
      const cv::Vec2d by_u =
          ((1 - down) * (at(k, i + 1) - at(k, i)) + down * (at(k + 1, i + 1) - at(k + 1, i))) / step_px;
      const cv::Vec2d gradients(std::max(1e-6, std::hypot(by_u[0], by_v[0])),
                                std::max(1e-6, std::hypot(by_u[1], by_v[1])));
      light.at<double>(v, u) = brightness(scene, (1 - down) * top + down * bottom, gradients);
    }
  return light;
}

cv::Mat sharpened(const BoardScene& scene, const cv::Mat& values) {
  if (scene.sharpening == 0) return values;
  cv::Mat smooth;
  cv::GaussianBlur(values, smooth, {}, scene.sharpening_px);
  return values + scene.sharpening * (values - smooth);
}

}  // namespace

cv::Mat render_board(const BoardScene& scene, const Camera& camera, const Rigid3& camera_from_board,
                     std::uint64_t seed) {
  Random random(seed);
  const double lamp_u = random.uniform(0.3, 0.7) * camera.width_px,
               lamp_v = random.uniform(0.3, 0.7) * camera.height_px;
  cv::Mat values(camera.height_px, camera.width_px, CV_64FC3);
  const std::array<double, 3> magnifications{camera.chromatic_aberration.blue, 1, camera.chromatic_aberration.red};
  cv::Mat parts;
  for (int c = 0; c < 3; ++c) {
    const double magnification = magnifications[static_cast<std::size_t>(c)];
    if (c == 0 || magnification != magnifications[static_cast<std::size_t>(c - 1)])
      parts = pattern(scene, camera, places_on_board(scene, camera, camera_from_board, magnification));
    for (int v = 0; v < values.rows; ++v)
      for (int u = 0; u < values.cols; ++u) {
        const double from_lamp_px2 = (u - lamp_u) * (u - lamp_u) + (v - lamp_v) * (v - lamp_v);
        const double lamp = 1 / (1 + scene.falloff * from_lamp_px2 / (camera.width_px * camera.width_px));
        const double reflected = scene.dark + (scene.bright - scene.dark) * parts.at<double>(v, u);
        const double light = scene.exposure * lamp * reflected;
        const double noise = scene.noise * std::sqrt(0.25 + 0.75 * light) * random.normal();
        values.at<cv::Vec3d>(v, u)[c] = camera.response.value_from_light(std::clamp(light + noise, 0.0, 1.0));
      }
  }
  cv::Mat bgr;
  sharpened(scene, values).convertTo(bgr, CV_8UC3, 255);
  return bgr;
}

std::vector<Rigid3> board_poses(const BoardScene& scene, const Camera& camera, int count, std::uint64_t seed) {
  Random random(seed);
  const Eigen::Vector3d middle_m(0.5 * scene.square_m * (scene.columns - 1), 0.5 * scene.square_m * (scene.rows - 1),
                                 0);
  std::vector<Rigid3> poses;
  while (static_cast<int>(poses.size()) < count) {
    const double direction = two_pi * (static_cast<double>(poses.size()) + random.uniform(0, 0.5)) / 5;
    const double tilt = rad_from_deg(random.uniform(15, 35));
    Rigid3 pose;
    pose.rotation = Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(direction), std::sin(direction), 0)) *
                    Eigen::AngleAxisd(random.uniform(-0.3, 0.3), Eigen::Vector3d::UnitZ());
    const double share = random.uniform(0.4, 0.6);  // of the image's width
    const double depth_m = camera.fx_px * scene.square_m * (scene.columns + 1) / (share * camera.width_px);
    const double v_px = random.uniform(0.2, 0.8) * camera.height_px, u_px = random.uniform(0.2, 0.8) * camera.width_px;
    const Eigen::Vector2d at(u_px, v_px);
    pose.translation = depth_m * camera.ray_from_ideal(at) - pose.rotation * middle_m;
    bool in_view = true;
    for (const double x : {-1.2, scene.columns + 0.2})
      for (const double y : {-1.2, scene.rows + 0.2})
        in_view =
            in_view && camera.contains(
                           camera.raw_from_point(pose * Eigen::Vector3d(x * scene.square_m, y * scene.square_m, 0)), 4);
    if (in_view) poses.push_back(pose);
  }
  return poses;
}

}  // namespace lapservo::internal
