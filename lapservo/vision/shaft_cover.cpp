#include "lapservo/vision/shaft_cover.h"

#include <algorithm>
#include <cmath>

#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"

namespace lapservo::internal {
namespace {

constexpr double doubt_px = 3;      // of where the shaft and its colours lie
constexpr double before_m = 0.3;    // of the marker, at most so much of the shaft
constexpr double beyond = 0.5;      // of the marker's length: nobody knows where the shaft ends
constexpr double nearest_m = 0.01;  // to the camera

Eigen::Vector3d on_axis(const ShaftPose& pose, double along_m) {
  return pose.camera_from_unrolled * Eigen::Vector3d(0, 0, along_m);
}

}  // namespace

ShaftCover::ShaftCover(const Camera& camera) {
  const auto cells = [](int size_px) { return static_cast<std::size_t>(size_px / cell_px + 1); };
  cells_.reserve(cells(camera.width_px) * cells(camera.height_px));
  sections_.reserve(static_cast<std::size_t>(camera.width_px) + static_cast<std::size_t>(camera.height_px));
}

void ShaftCover::draw(const Camera& camera, const Marker& marker, const std::array<std::uint8_t, 3>& bands,
                      const ShaftPose& pose) {
  drawn_ = true;
  columns_ = rows_ = 0;
  sections_.clear();
  const auto view = view_cylinder(pose.camera_from_unrolled, marker.radius_m());
  if (!view) return;
  EndsOfLines ends_m;
  for (std::size_t i = 0; i < lines; ++i) {
    const double sine = (2.0 * static_cast<double>(i) + 1) / static_cast<double>(lines) - 1;
    ends_m[i] =
        boundaries_m(marker, marker_azimuth_rad(marker, view->facing_azimuth_rad + std::asin(sine), pose.psi_rad));
  }
  const auto silhouette = [&](double side, double along_m) -> Eigen::Vector3d {
    return pose.camera_from_unrolled *
           surface_point(marker.radius_m(), view->facing_azimuth_rad + side * view->half_visible_rad, along_m);
  };
  const auto section_at = [&](double along_m) -> std::optional<Section> {
    const Eigen::Vector3d left = silhouette(-1, along_m), right = silhouette(1, along_m);
    const Eigen::Vector3d axis = on_axis(pose, along_m), next = on_axis(pose, along_m + 1e-4);
    if (std::min({left.z(), right.z(), axis.z(), next.z()}) < nearest_m) return std::nullopt;
    Section section{along_m, 0, axis.z(), camera.raw_from_point(left), camera.raw_from_point(right)};
    section.px_per_m = (camera.raw_from_point(next) - camera.raw_from_point(axis)).norm() / 1e-4;
    const Eigen::Vector2d out_px = doubt_px * (section.right_px - section.left_px).normalized();
    section.left_px -= out_px, section.right_px += out_px;
    return section;
  };
  const auto in_image = [&](const Section& section) {
    return camera.contains(section.left_px) || camera.contains(section.right_px) ||
           camera.contains((section.left_px + section.right_px) / 2);
  };
  double along_m = (1 + beyond) * marker.length_m();
  while (along_m > -before_m) {
    const auto section = section_at(along_m);
    constexpr double largest_step_m = 1e-3;
    along_m -= section ? std::min(largest_step_m, cell_px / 2 / std::max(1.0, section->px_per_m)) : largest_step_m;
    if (section && in_image(*section)) sections_.push_back(*section);
  }
  if (sections_.empty()) return;
  frame(camera);
  for (const Section& section : sections_) fill(section, marker, ends_m, bands);
}

void ShaftCover::frame(const Camera& camera) {
  Eigen::Vector2d first(1e9, 1e9), last(-1e9, -1e9);
  for (const Section& section : sections_)
    for (const Eigen::Vector2d& place : {section.left_px, section.right_px})
      first = first.cwiseMin(place), last = last.cwiseMax(place);
  const auto cell = [](double px, int size_px) {
    return static_cast<int>(std::clamp(px, 0.0, size_px - 1.0)) / cell_px;
  };
  left_ = cell(first.x(), camera.width_px), top_ = cell(first.y(), camera.height_px);
  columns_ = cell(last.x(), camera.width_px) - left_ + 1, rows_ = cell(last.y(), camera.height_px) - top_ + 1;
  cells_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), Cell{});
}

void ShaftCover::fill(const Section& section, const Marker& marker, const EndsOfLines& ends_m,
                      const std::array<std::uint8_t, 3>& bands) {
  const Eigen::Vector2d across_px = section.right_px - section.left_px;
  const double width_px = across_px.norm(), doubt_m = doubt_px / std::max(1.0, section.px_per_m);
  const bool marked = section.along_m > -marker.length_m() / 2 && section.along_m < 1.5 * marker.length_m();
  const int steps = static_cast<int>(width_px / (cell_px / 2)) + 1;
  for (int i = 0; i <= steps; ++i) {
    const double fraction = static_cast<double>(i) / steps;
    const Eigen::Vector2d place_px = section.left_px + fraction * across_px;
    const auto at = index(place_px.x(), place_px.y());
    if (!at) continue;
    Cell& cell = cells_[*at];
    cell.axis_depth_m = static_cast<float>(section.axis_depth_m);
    if (!marked) continue;
    const double inside = std::clamp((fraction * width_px - doubt_px) / (width_px - 2 * doubt_px), 0.0, 1.0);
    const auto& line_ends_m =
        ends_m[std::min(static_cast<std::size_t>(inside * static_cast<double>(lines)), lines - 1)];
    for (std::size_t band = 0; band < 3; ++band)
      if (section.along_m > line_ends_m[band] - doubt_m && section.along_m < line_ends_m[band + 1] + doubt_m)
        cell.colors |= bit(bands[band]);
  }
}

bool may_meet(const Camera& camera, const Marker& marker, const ShaftPose& pose, const Marker& others_marker,
              const ShaftPose& other) {
  constexpr double doubt_of_place_px = 30;
  const Eigen::Vector3d near_end = on_axis(pose, 0), far_end = on_axis(pose, marker.length_m());
  if (std::min(near_end.z(), far_end.z()) < nearest_m) return false;
  const Eigen::Vector2d first = camera.ideal_from_point(near_end), last = camera.ideal_from_point(far_end);
  const double radius_px = marker.radius_m() / std::min(near_end.z(), far_end.z()) * camera.fx_px;
  const double reach_px = (last - first).norm() / 2 + radius_px + doubt_of_place_px;
  // The other's axis, as far as it lies before the camera.
  Eigen::Vector3d from = on_axis(other, -before_m), to = on_axis(other, (1 + beyond) * others_marker.length_m());
  if (std::max(from.z(), to.z()) < nearest_m) return false;
  for (Eigen::Vector3d* end : {&from, &to}) {
    const Eigen::Vector3d& across = end == &from ? to : from;
    if (end->z() < nearest_m) *end += (nearest_m - end->z()) / (across.z() - end->z()) * (across - *end);
  }
  const Eigen::Vector2d a = camera.ideal_from_point(from), way = camera.ideal_from_point(to) - a;
  const double nearest = std::clamp(((first + last) / 2 - a).dot(way) / std::max(1.0, way.squaredNorm()), 0.0, 1.0);
  const double others_radius_px = others_marker.radius_m() / on_axis(other, 0).z() * camera.fx_px;
  return (a + nearest * way - (first + last) / 2).norm() < reach_px + 1.5 * others_radius_px;
}

}  // namespace lapservo::internal
