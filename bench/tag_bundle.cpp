#include "bench/tag_bundle.h"

#include <algorithm>
#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <cmath>
#include <stdexcept>

#include <opencv2/calib3d.hpp>

#include "lapservo/core/angles.h"

namespace lapservo::bench {
using namespace internal;
namespace {

// Of a corner; what is farther off is another tag's, or a shadow's.
constexpr double loss_px = 0.5;

struct CornerError {
  Eigen::Vector3d point_m;
  Eigen::Vector2d seen_px;
  Eigen::Vector4d focal_and_centre_px;

  template <typename T>
  bool operator()(const T* turn, const T* shift, T* error) const {
    const T point[3] = {T(point_m.x()), T(point_m.y()), T(point_m.z())};
    T at[3];
    ceres::AngleAxisRotatePoint(turn, point, at);
    for (int i = 0; i < 3; ++i) at[i] += shift[i];
    error[0] = focal_and_centre_px[0] * at[0] / at[2] + focal_and_centre_px[2] - seen_px.x();
    error[1] = focal_and_centre_px[1] * at[1] / at[2] + focal_and_centre_px[3] - seen_px.y();
    return true;
  }
};

}  // namespace

TagBundle::TagBundle(const Marker& film, const std::vector<TagCells>& tags, int around) {
  const int size = tags.at(0).size, pitch = size + 1;  // neighbours share a bright cell
  const double cell_m = pi * film.diameter_m / (around * pitch);
  const int fit = static_cast<int>(std::lround((film.length_m() / cell_m - 1) / pitch));
  const int along = std::clamp(fit, 1, static_cast<int>(tags.size()) / around);
  print_.rows = around * pitch, print_.columns = along * pitch + 1;
  print_.dark.assign(static_cast<std::size_t>(print_.rows * print_.columns), 0);
  const auto place_m = [&](int row, int column) {
    const double tau_rad = two_pi * row / print_.rows;
    return Eigen::Vector3d(film.radius_m() * std::cos(tau_rad), film.radius_m() * std::sin(tau_rad),
                           film.length_m() * column / print_.columns);
  };
  std::size_t number = 0;
  for (int ring = 0; ring < along; ++ring)
    for (int i = 0; i < around; ++i) {
      const TagCells& tag = tags.at(number++);
      const int row = i * pitch + (ring % 2) * (pitch / 2), column = ring * pitch + 1;
      for (int r = 0; r < size; ++r)
        for (int c = 0; c < size; ++c)
          print_.dark[static_cast<std::size_t>((row + r) % print_.rows * print_.columns + column + c)] =
              tag.dark[static_cast<std::size_t>(r * size + c)];
      corners_.push_back({place_m(row, column), place_m(row, column + size), place_m(row + size, column + size),
                          place_m(row + size, column)});
    }
}

std::optional<Rigid3> bundle_pose(const TagBundle& bundle, const std::vector<FoundTag>& found, const Camera& camera) {
  if (found.empty()) return std::nullopt;
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
  for (const FoundTag& tag : found)
    for (std::size_t k = 0; k < 4; ++k) {
      const Eigen::Vector3d& m = bundle.corners_m(tag.tag)[k];
      points.emplace_back(m.x(), m.y(), m.z());
      pixels.emplace_back(tag.ideal_px[k].x(), tag.ideal_px[k].y());
    }
  const cv::Matx33d matrix(camera.fx_px, 0, camera.cx_px, 0, camera.fy_px, camera.cy_px, 0, 0, 1);
  cv::Mat turn, shift, inliers;
  // Of a few that are wrong: the start must not be theirs.
  const bool started = found.size() > 1
                           ? cv::solvePnPRansac(points, pixels, matrix, {}, turn, shift, false, 200, 4.0F, 0.999,
                                                inliers, cv::SOLVEPNP_SQPNP)
                           : cv::solvePnP(points, pixels, matrix, {}, turn, shift, false, cv::SOLVEPNP_SQPNP);
  if (!started) return std::nullopt;
  ceres::Problem problem;
  const Eigen::Vector4d focal_and_centre_px(camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px);
  for (std::size_t i = 0; i < points.size(); ++i)
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<CornerError, 2, 3, 3>(
            new CornerError{{points[i].x, points[i].y, points[i].z}, {pixels[i].x, pixels[i].y}, focal_and_centre_px}),
        new ceres::CauchyLoss(loss_px), turn.ptr<double>(), shift.ptr<double>());
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable() || !(shift.at<double>(2) > 0)) return std::nullopt;
  const Eigen::Vector3d by(turn.at<double>(0), turn.at<double>(1), turn.at<double>(2));
  const double angle_rad = by.norm();
  Rigid3 pose;
  if (angle_rad > 0) pose.rotation = Eigen::AngleAxisd(angle_rad, by / angle_rad);
  pose.translation = {shift.at<double>(0), shift.at<double>(1), shift.at<double>(2)};
  return pose;
}

}  // namespace lapservo::bench
