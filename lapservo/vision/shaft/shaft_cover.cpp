#include "lapservo/vision/shaft/shaft_cover.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/image/lens_field.h"

namespace lapservo::internal {
namespace {

constexpr double doubt_px = 5;         // of where the shaft and its colours lie
constexpr double before_m = 0.3;       // of the marker, at most so much of the shaft
constexpr double reach_lengths = 0.5;  // of the marker's length: nobody knows where the shaft ends

bool has(const std::array<std::uint8_t, 3>& bands, std::uint8_t colour) {
  return colour == bands[0] || colour == bands[1] || colour == bands[2];
}

std::optional<Eigen::Vector3d> ray_at(const Camera& camera, const Eigen::Vector2d& raw_px) {
  const auto ideal_px = camera.ideal_from_raw(raw_px);
  return ideal_px ? std::optional(camera.ray_from_ideal(*ideal_px)) : std::nullopt;
}

}  // namespace

ShaftCover::ShaftCover(const Camera& camera, const Marker& marker, const std::array<std::uint8_t, 3>& bands,
                       const ShaftPose& pose)
    : camera_(&camera),
      marker_(&marker),
      bands_(bands),
      psi_rad_(pose.psi_rad),
      unrolled_from_camera_(pose.camera_from_unrolled.rotation.conjugate().toRotationMatrix()),
      eye_(-(unrolled_from_camera_ * pose.camera_from_unrolled.translation)) {}

ShaftCover::Passage ShaftCover::passage(const Eigen::Vector3d& ray) const {
  const Eigen::Vector3d way = unrolled_from_camera_ * (ray / ray.z());
  const double across = way.head<2>().norm(), depth_m = -way.head<2>().dot(eye_.head<2>()) / (across * across);
  const double apart_m = std::abs(eye_.x() * way.y() - eye_.y() * way.x()) / across;
  return {way, across, eye_.z() + depth_m * way.z(), apart_m, depth_m, depth_m / camera_->fx_px};
}

bool ShaftCover::is_shaft(const Passage& at, double margin_px) const {
  const double reach_m = marker_->radius_m() + margin_px * at.m_per_px;
  if (!(at.depth_m > LensField::nearest_m && at.apart_m < reach_m)) return false;
  const double end_m = (1 + reach_lengths) * marker_->length_m();
  const double beyond_m = std::max({0.0, -before_m - at.along_m, at.along_m - end_m});
  return beyond_m == 0 || std::hypot(at.apart_m, at.sine() * beyond_m) < reach_m;
}

bool ShaftCover::hides(const Eigen::Vector3d& point) const {
  const Passage at = passage(point);
  return at.depth_m < point.z() && is_shaft(at, doubt_px);
}

// By what the line of sight meets of the marker's surface, or passes nearest.
bool ShaftCover::explains(const Eigen::Vector2d& raw_px, std::uint8_t colour) const {
  if (!has(bands_, colour)) return false;
  const auto ray = ray_at(*camera_, raw_px);
  if (!ray) return false;
  const Passage at = passage(*ray);
  if (!is_shaft(at, doubt_px)) return false;
  const double radius_m = marker_->radius_m();
  const double inside_m = std::sqrt(std::max(0.0, radius_m * radius_m - at.apart_m * at.apart_m));
  const Eigen::Vector3d seen = eye_ + (at.depth_m - inside_m / at.across) * at.way;
  const double doubt_m = doubt_px * at.m_per_px / at.sine();
  const auto ends_m = boundaries_m(*marker_, marker_azimuth_rad(*marker_, std::atan2(seen.y(), seen.x()), psi_rad_));
  for (std::size_t band = 0; band < 3; ++band)
    if (colour == bands_[band] && seen.z() > ends_m[band] - doubt_m && seen.z() < ends_m[band + 1] + doubt_m)
      return true;
  return false;
}

bool ShaftCover::may_meet(const Marker& marker, const ShaftPose& pose) const {
  constexpr double apart_px = 12;
  constexpr int places = 8;
  for (int i = 0; i <= places; ++i) {
    const Eigen::Vector3d place = point_on_axis(pose, marker.length_m() * i / places);
    if (place.z() > LensField::nearest_m &&
        is_shaft(passage(place), apart_px + camera_->fx_px * marker.radius_m() / place.z()))
      return true;
  }
  return false;
}

bool ShaftCover::lies_before(const Marker& marker, const ShaftPose& pose) const {
  return std::ranges::any_of(std::array{0.0, 0.5, 1.0}, [&](double part) {
    const Eigen::Vector3d place = point_on_axis(pose, part * marker.length_m());
    return passage(place).depth_m < place.z();
  });
}

bool ShaftCover::lies_beside(const Blob& blob, const std::array<std::uint8_t, 3>& bands) const {
  constexpr double beside_px = 24, doubt = 0.12;  // of the length, by which a leaning marker's ends bulge
  int samples = 0;
  for (const Blob::Sample& sample : blob.samples) {
    if (!has(bands, sample.colour)) continue;
    const auto ray = ray_at(*camera_, Eigen::Vector2d(sample.u, sample.v));
    if (!ray) continue;
    const Passage at = passage(*ray);
    const double along = at.along_m / marker_->length_m();
    const bool explained = along > -doubt && along < 1 + doubt && is_shaft(at, blob_grid_px / 2.0);
    samples += is_shaft(at, beside_px) && !explained;
  }
  return samples >= min_blob_samples;
}

bool explained_by(std::span<const ShaftCover* const> others, const Eigen::Vector2d& raw_px, std::uint8_t colour) {
  return std::ranges::any_of(others, [&](const ShaftCover* other) { return other->explains(raw_px, colour); });
}

bool hidden_by(std::span<const ShaftCover* const> others, const Eigen::Vector3d& point) {
  return std::ranges::any_of(others, [&](const ShaftCover* other) { return other->hides(point); });
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
