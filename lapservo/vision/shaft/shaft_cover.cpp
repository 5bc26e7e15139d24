#include "lapservo/vision/shaft/shaft_cover.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>

#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/image/lens_field.h"

namespace lapservo::internal {
namespace {

constexpr double doubt_px = 3;         // of where the shaft and its colours lie
constexpr double before_m = 0.3;       // of the marker, at most so much of the shaft
constexpr double reach_lengths = 0.5;  // of the marker's length: nobody knows where the shaft ends
constexpr double nearest_m = LensField::nearest_m;

// A part of a shaft's axis as the image shows it, without the lens's distortion.
struct Segment {
  Eigen::Vector2d from_px, to_px;
  double nearest_m;  // depth
};

// As far as it lies before the camera.
std::optional<Segment> axis_in_image(const Camera& camera, const ShaftPose& pose, double from_m, double to_m) {
  Eigen::Vector3d from = point_on_axis(pose, from_m), to = point_on_axis(pose, to_m);
  if (std::max(from.z(), to.z()) < nearest_m) return std::nullopt;
  const Eigen::Vector3d way = to - from;
  if (from.z() < nearest_m) from += (nearest_m - from.z()) / way.z() * way;
  if (to.z() < nearest_m) to += (nearest_m - to.z()) / way.z() * way;
  return Segment{camera.ideal_from_point(from), camera.ideal_from_point(to), std::min(from.z(), to.z())};
}

// With what may be seen of the shaft on both sides.
std::optional<Segment> shaft_in_image(const Camera& camera, const Marker& marker, const ShaftPose& pose) {
  return axis_in_image(camera, pose, -before_m, (1 + reach_lengths) * marker.length_m());
}

double distance_px(const Segment& segment, const Eigen::Vector2d& place_px) {
  const Eigen::Vector2d way = segment.to_px - segment.from_px;
  const double at = std::clamp((place_px - segment.from_px).dot(way) / std::max(1.0, way.squaredNorm()), 0.0, 1.0);
  return (segment.from_px + at * way - place_px).norm();
}

double distance_px(const Segment& a, const Segment& b) {
  const auto side = [](const Segment& of, const Eigen::Vector2d& place_px) {
    const Eigen::Vector2d way = of.to_px - of.from_px, to = place_px - of.from_px;
    return way.x() * to.y() - way.y() * to.x();
  };
  if (side(a, b.from_px) * side(a, b.to_px) < 0 && side(b, a.from_px) * side(b, a.to_px) < 0) return 0;
  return std::min(
      {distance_px(a, b.from_px), distance_px(a, b.to_px), distance_px(b, a.from_px), distance_px(b, a.to_px)});
}

}  // namespace

void ShaftCover::reserve(const Camera& camera) {
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
  const auto generatrix_at = [&](double side, double along_m) {
    return point_on(pose, marker, view->facing_azimuth_rad + side * view->half_visible_rad, along_m);
  };
  const LensField field(camera);
  const auto section_at = [&](double along_m) -> std::optional<Section> {
    const Eigen::Vector3d left = generatrix_at(-1, along_m), right = generatrix_at(1, along_m),
                          front = generatrix_at(0, along_m);
    const Eigen::Vector3d axis = point_on_axis(pose, along_m);
    for (const Eigen::Vector3d& point : {left, right, front, axis})
      if (!field.contains(point)) return std::nullopt;
    Section section{along_m, 0, axis.z(), camera.raw_from_point(left), camera.raw_from_point(right), {}};
    section.bulge_px = camera.raw_from_point(front) - (section.left_px + section.right_px) / 2;
    section.px_per_m = px_per_m_along(camera, pose, axis);
    const Eigen::Vector2d out_px = doubt_px * (section.right_px - section.left_px).normalized();
    section.left_px -= out_px, section.right_px += out_px;
    return section;
  };
  const auto in_image = [&](const Section& section) {
    return camera.contains(section.left_px) || camera.contains(section.right_px) ||
           camera.contains((section.left_px + section.right_px) / 2);
  };
  double along_m = (1 + reach_lengths) * marker.length_m();
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
  Eigen::AlignedBox2d box_px;
  for (const Section& section : sections_) box_px.extend(section.left_px).extend(section.right_px);
  const auto cell = [](double px, int size_px) {
    return static_cast<int>(std::clamp(px, 0.0, size_px - 1.0)) / cell_px;
  };
  left_ = cell(box_px.min().x(), camera.width_px), top_ = cell(box_px.min().y(), camera.height_px);
  columns_ = cell(box_px.max().x(), camera.width_px) - left_ + 1;
  rows_ = cell(box_px.max().y(), camera.height_px) - top_ + 1;
  cells_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), Cell{});
}

void ShaftCover::fill(const Section& section, const Marker& marker, const EndsOfLines& ends_m,
                      const std::array<std::uint8_t, 3>& bands) {
  const Eigen::Vector2d across_px = section.right_px - section.left_px;
  const double width_px = across_px.norm(), doubt_m = doubt_px / std::max(1.0, section.px_per_m);
  const bool marked =
      section.along_m > -marker.length_m() / 2 && section.along_m < (1 + reach_lengths) * marker.length_m();
  const int steps = static_cast<int>(width_px / (cell_px / 2)) + 1;
  for (int i = 0; i <= steps; ++i) {
    const double fraction = static_cast<double>(i) / steps;
    const double inside = std::clamp((fraction * width_px - doubt_px) / (width_px - 2 * doubt_px), 0.0, 1.0);
    const double bulge = 2 * std::sqrt(inside * (1 - inside));  // a circle seen from aside
    const Eigen::Vector2d place_px = section.left_px + fraction * across_px + bulge * section.bulge_px;
    const auto at = index(place_px.x(), place_px.y());
    if (!at) continue;
    Cell& cell = cells_[*at];
    cell.axis_depth_m = static_cast<float>(section.axis_depth_m);
    if (!marked) continue;
    const auto& line_ends_m =
        ends_m[std::min(static_cast<std::size_t>(inside * static_cast<double>(lines)), lines - 1)];
    for (std::size_t band = 0; band < 3; ++band)
      if (section.along_m > line_ends_m[band] - doubt_m && section.along_m < line_ends_m[band + 1] + doubt_m)
        cell.colours |= bit(bands[band]);
  }
}

bool may_meet(const Camera& camera, const Marker& marker, const ShaftPose& pose, const Marker& others_marker,
              const ShaftPose& other) {
  constexpr double apart_px = 12;
  const auto marked = axis_in_image(camera, pose, 0, marker.length_m());
  const auto shaft = shaft_in_image(camera, others_marker, other);
  if (!marked || !shaft) return false;
  // The part of the other's shaft that is nearest to the camera may be far from here.
  const double others_nearest_m = std::max({nearest_m, shaft->nearest_m, point_on_axis(other, 0).z() / 2});
  const double radii_px =
      camera.fx_px * (marker.radius_m() / marked->nearest_m + others_marker.radius_m() / others_nearest_m);
  return distance_px(*marked, *shaft) < radii_px + apart_px;
}

bool lies_before(const ShaftPose& other, const Marker& marker, const ShaftPose& pose) {
  const Eigen::Vector3d from = point_on_axis(other, 0), way = point_on_axis(other, 1) - from;
  return std::ranges::any_of(std::array{0.0, 0.5, 1.0}, [&](double part) {
    const Eigen::Vector3d place = point_on_axis(pose, part * marker.length_m());
    return (from + way.dot(place - from) * way).z() < place.z();
  });
}

bool lies_beside(const Camera& camera, const Marker& others_marker, const ShaftPose& other, const Blob& blob,
                 const std::array<std::uint8_t, 3>& bands) {
  constexpr double beside_px = 24, doubt = 0.12;  // of the length, by which a leaning marker's ends bulge
  const auto shaft = shaft_in_image(camera, others_marker, other);
  const auto marked = axis_in_image(camera, other, 0, others_marker.length_m());
  if (!shaft || !marked) return false;
  const double radius_px = camera.fx_px * others_marker.radius_m() / marked->nearest_m;
  const Eigen::Vector2d along_px = marked->to_px - marked->from_px;
  const double length_px = std::max(1.0, along_px.norm());
  int samples = 0;
  for (const Blob::Sample& sample : blob.samples) {
    if (std::find(bands.begin(), bands.end(), sample.colour) == bands.end()) continue;
    const auto ideal_px = camera.ideal_from_raw(Eigen::Vector2d(sample.u, sample.v));
    if (!ideal_px) continue;
    const double away_px = distance_px(*shaft, *ideal_px);
    if (away_px > radius_px + beside_px) continue;
    const double at = (*ideal_px - marked->from_px).dot(along_px) / (length_px * length_px);
    const bool explained = at > -doubt && at < 1 + doubt && away_px < radius_px + blob_grid_px / 2.0;
    samples += !explained;
  }
  return samples >= min_blob_samples;
}

bool explained_by(std::span<const ShaftCover* const> others, const Eigen::Vector2d& raw_px, std::uint8_t colour) {
  return std::ranges::any_of(
      others, [&](const ShaftCover* other) { return other->explains(raw_px.x() + 0.5, raw_px.y() + 0.5, colour); });
}

bool hidden_by(std::span<const ShaftCover* const> others, const Eigen::Vector2d& raw_px, double depth_m) {
  return std::ranges::any_of(
      others, [&](const ShaftCover* other) { return other->hides(raw_px.x() + 0.5, raw_px.y() + 0.5, depth_m); });
}

std::vector<Blob> without(const std::vector<Blob>& blobs, std::span<const ShaftCover* const> others) {
  std::vector<Blob> left;
  for (Blob blob : blobs) {
    std::erase_if(blob.samples, [&](const Blob::Sample& sample) {
      return explained_by(others, Eigen::Vector2d(sample.u, sample.v), sample.colour);
    });
    if (static_cast<int>(blob.samples.size()) >= min_blob_samples) left.push_back(std::move(blob));
  }
  std::sort(left.begin(), left.end(), [](const Blob& a, const Blob& b) { return a.samples.size() > b.samples.size(); });
  return left;
}

}  // namespace lapservo::internal
