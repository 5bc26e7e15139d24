#include "bench/tag_bundle.h"

#include <algorithm>
#include <array>
#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <opencv2/calib3d.hpp>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/rotation.h"

namespace lapservo::bench {
using namespace internal;
namespace {

// The reach of a corner; anything farther off is another tag's, or a shadow's.
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

Eigen::Vector3d TagBundle::place_m(double row, double column) const {
  const double tau_rad = two_pi * row / print_.rows;
  return {radius_m_ * std::cos(tau_rad), radius_m_ * std::sin(tau_rad), length_m_ * column / print_.columns};
}

Eigen::Vector3d TagBundle::side_m(std::size_t tag, std::size_t corner, double part) const {
  const double at = tag_size_ * part, end = tag_size_;
  const auto [row, column] = places_[tag];
  switch (corner % 4) {
    case 0:
      return place_m(row, column + at);
    case 1:
      return place_m(row + at, column + end);
    case 2:
      return place_m(row + end, column + end - at);
    default:
      return place_m(row + end - at, column);
  }
}

TagBundle::TagBundle(const Marker& film, const std::vector<TagCells>& tags, int around)
    : radius_m_(film.radius_m()), length_m_(film.length_m()), tag_size_(tags.at(0).size) {
  const int size = tag_size_, pitch = size + 1;  // neighbours share a bright cell
  const double cell_m = pi * film.diameter_m / (around * pitch);
  const int fit = static_cast<int>(std::lround((film.length_m() / cell_m - 1) / pitch));
  const int along = std::clamp(fit, 1, static_cast<int>(tags.size()) / around);
  print_.rows = around * pitch, print_.columns = along * pitch + 1;
  print_.dark.assign(static_cast<std::size_t>(print_.rows * print_.columns), 0);
  for (int ring = 0; ring < along; ++ring)
    for (int i = 0; i < around; ++i) {
      const TagCells& tag = tags.at(places_.size());
      const int row = i * pitch + (ring % 2) * (pitch / 2), column = ring * pitch + 1;
      for (int r = 0; r < size; ++r)
        for (int c = 0; c < size; ++c)
          print_.dark[static_cast<std::size_t>((row + r) % print_.rows * print_.columns + column + c)] =
              tag.dark[static_cast<std::size_t>(r * size + c)];
      places_.push_back({row, column});
      corners_.push_back({place_m(row, column), place_m(row, column + size), place_m(row + size, column + size),
                          place_m(row + size, column)});
    }
}

namespace {

using Corners = std::array<Eigen::Vector2d, 4>;

struct Line {
  Eigen::Vector2d through, normal;
};

// Through a side as the camera sees it, by total least squares, as a detector fits it to the gradient's points.
Line straight_side(const TagBundle& bundle, std::size_t tag, std::size_t corner, const Rigid3& pose,
                   const Camera& camera) {
  constexpr int count = 16;
  Eigen::Matrix2Xd points(2, count);
  for (int i = 0; i < count; ++i)
    points.col(i) = camera.ideal_from_point(pose * bundle.side_m(tag, corner, (i + 0.5) / count));
  const Eigen::Vector2d middle = points.rowwise().mean();
  const Eigen::Matrix2Xd off = points.colwise() - middle;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(off * off.transpose());
  return {middle, axes.eigenvectors().col(0)};
}

// Where straight sides of a bent tag meet, beside where its corners are.
Corners beside_px(const TagBundle& bundle, std::size_t tag, const Rigid3& pose, const Camera& camera) {
  std::array<Line, 4> sides;
  for (std::size_t k = 0; k < 4; ++k) sides[k] = straight_side(bundle, tag, k, pose, camera);
  Corners beside;
  for (std::size_t k = 0; k < 4; ++k) {
    const Line &one = sides[(k + 3) % 4], &other = sides[k];
    Eigen::Matrix2d normals;
    normals << one.normal.transpose(), other.normal.transpose();
    const Eigen::Vector2d meet =
        normals.inverse() * Eigen::Vector2d(one.normal.dot(one.through), other.normal.dot(other.through));
    beside[k] = meet - camera.ideal_from_point(pose * bundle.corners_m(tag)[k]);
  }
  return beside;
}

struct Start {
  cv::Mat turn, shift;
};

struct Points {
  std::vector<cv::Point3d> marker;
  std::vector<cv::Point2d> ideal_px;
};

Points points_of(const TagBundle& bundle, const std::vector<FoundTag>& found) {
  Points points;
  for (const FoundTag& tag : found)
    for (std::size_t k = 0; k < 4; ++k) {
      const Eigen::Vector3d& m = bundle.corners_m(tag.tag)[k];
      points.marker.emplace_back(m.x(), m.y(), m.z());
      points.ideal_px.emplace_back(tag.ideal_px[k].x(), tag.ideal_px[k].y());
    }
  return points;
}

// Robust to a few wrong ones: the start must not be theirs.
std::optional<Start> start_of(const Points& points, const Camera& camera) {
  const cv::Matx33d matrix(camera.fx_px, 0, camera.cx_px, 0, camera.fy_px, camera.cy_px, 0, 0, 1);
  Start start;
  cv::Mat inliers;
  const bool started = points.marker.size() > 4
                           ? cv::solvePnPRansac(points.marker, points.ideal_px, matrix, {}, start.turn, start.shift,
                                                false, 200, 4.0F, 0.999, inliers, cv::SOLVEPNP_SQPNP)
                           : cv::solvePnP(points.marker, points.ideal_px, matrix, {}, start.turn, start.shift, false,
                                          cv::SOLVEPNP_SQPNP);
  return started ? std::optional(start) : std::nullopt;
}

std::optional<Rigid3> refined(Start& start, const Points& points, const Camera& camera) {
  ceres::Problem problem;
  const Eigen::Vector4d focal_and_centre_px(camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px);
  for (std::size_t i = 0; i < points.marker.size(); ++i) {
    const cv::Point3d& m = points.marker[i];
    const cv::Point2d& p = points.ideal_px[i];
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<CornerError, 2, 3, 3>(
                                 new CornerError{{m.x, m.y, m.z}, {p.x, p.y}, focal_and_centre_px}),
                             new ceres::CauchyLoss(loss_px), start.turn.ptr<double>(), start.shift.ptr<double>());
  }
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable() || !(start.shift.at<double>(2) > 0)) return std::nullopt;
  const Eigen::Vector3d by(start.turn.at<double>(0), start.turn.at<double>(1), start.turn.at<double>(2));
  return Rigid3{rotation_by(by), {start.shift.at<double>(0), start.shift.at<double>(1), start.shift.at<double>(2)}};
}

}  // namespace

std::optional<Rigid3> bundle_pose(const TagBundle& bundle, const std::vector<FoundTag>& found, const Camera& camera,
                                  CornersBy corners) {
  if (found.empty()) return std::nullopt;
  const Points seen = points_of(bundle, found);
  auto start = start_of(seen, camera);
  if (!start) return std::nullopt;
  auto pose = refined(*start, seen, camera);
  constexpr int rounds = 3;
  for (int round = 0; round < rounds && pose && corners == CornersBy::straight_sides; ++round) {
    std::vector<FoundTag> moved = found;
    for (FoundTag& tag : moved) {
      const Corners beside = beside_px(bundle, tag.tag, *pose, camera);
      for (std::size_t k = 0; k < 4; ++k) tag.ideal_px[k] -= beside[k];
    }
    pose = refined(*start, points_of(bundle, moved), camera);
  }
  return pose;
}

}  // namespace lapservo::bench
