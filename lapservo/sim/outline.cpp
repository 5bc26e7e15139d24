#include "lapservo/sim/outline.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace lapservo::internal {
namespace {

constexpr double step_px = 4;
constexpr int band_rows = 16;

// Columns `begin` to `end` (exclusive) of a band of rows; empty when they meet.
struct Span {
  int begin = 0, end = 0;
  bool empty() const { return begin >= end; }
};

void widen(std::vector<Span>& bands, const Disc& disc, int width_px) {
  const double radius2 = disc.radius_px * disc.radius_px;
  const auto count = static_cast<double>(bands.size());
  const double first = std::clamp(std::floor((disc.centre_px.y() - disc.radius_px) / band_rows), 0.0, count);
  const double last = std::clamp(std::floor((disc.centre_px.y() + disc.radius_px) / band_rows), -1.0, count - 1);
  for (int b = static_cast<int>(first); b <= static_cast<int>(last); ++b) {
    const double above = b * band_rows - disc.centre_px.y(), below = disc.centre_px.y() - ((b + 1) * band_rows - 1);
    const double off = std::max({0.0, above, below});
    if (off * off >= radius2) continue;
    const double half = std::sqrt(radius2 - off * off);
    const int begin = static_cast<int>(std::clamp(std::floor(disc.centre_px.x() - half), 0.0, 1.0 * width_px));
    const int end = static_cast<int>(std::clamp(std::ceil(disc.centre_px.x() + half) + 1, 0.0, 1.0 * width_px));
    if (begin >= end) continue;
    Span& span = bands[static_cast<std::size_t>(b)];
    span = span.empty() ? Span{begin, end} : Span{std::min(span.begin, begin), std::max(span.end, end)};
  }
}

void widen_along(std::vector<Span>& bands, const Camera& camera, double half_field_rad, const Capsule& thing,
                 double margin_px) {
  const Eigen::Vector3d &from_m = thing.from_m, &to_m = thing.to_m;
  const double length_m = (to_m - from_m).norm();
  for (double along_m = 0;;) {
    const Eigen::Vector3d point = length_m > 0 ? from_m + along_m / length_m * (to_m - from_m) : from_m;
    Disc disc = disc_around_ball(camera, half_field_rad, point, thing.radius_m);
    if (disc.radius_px > 0) {
      disc.radius_px += margin_px + 1;
      widen(bands, disc, camera.width_px);
    }
    if (!(along_m < length_m)) break;
    along_m = std::min(along_m + std::max(1e-4, step_px * std::max(point.z(), 0.01) / camera.fx_px), length_m);
  }
}

}  // namespace

Disc disc_around_ball(const Camera& camera, double half_field_rad, const Eigen::Vector3d& centre, double radius_m) {
  if (centre.z() < 1.5 * radius_m) return {};
  const double off_axis_rad = std::atan2(centre.head<2>().norm(), centre.z());
  if (off_axis_rad - std::asin(radius_m / centre.norm()) > half_field_rad) return {};
  // Off the axis a ball's image is stretched outwards; a lens with pincushion distortion stretches it further.
  const Eigen::Vector2d middle(camera.cx_px, camera.cy_px), ideal = camera.ideal_from_point(centre);
  const Eigen::Vector2d raw = camera.raw_from_ideal(ideal);
  const double lens = std::max(1.0, (raw - middle).norm() / std::max(1.0, (ideal - middle).norm()));
  const double stretch = lens * centre.norm() / centre.z();
  const double per_m = std::max(camera.fx_px, camera.fy_px) / std::sqrt(centre.z() * centre.z() - radius_m * radius_m);
  return {raw, radius_m * per_m * stretch * stretch};
}

std::vector<cv::Rect> outline(const Camera& camera, double half_field_rad, const std::vector<Capsule>& things,
                              double margin_px) {
  std::vector<Span> bands(static_cast<std::size_t>((camera.height_px + band_rows - 1) / band_rows));
  for (const Capsule& thing : things) widen_along(bands, camera, half_field_rad, thing, margin_px);
  std::vector<cv::Rect> parts;
  for (int b = 0; b * band_rows < camera.height_px; ++b)
    if (const Span& span = bands[static_cast<std::size_t>(b)]; !span.empty())
      parts.emplace_back(span.begin, b * band_rows, span.end - span.begin,
                         std::min(band_rows, camera.height_px - b * band_rows));
  return parts;
}

}  // namespace lapservo::internal
