#include "lapservo/vision/decision/two_moments.h"

#include <algorithm>
#include <cstddef>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/shaft/sampled_surface.h"

namespace lapservo::internal {
namespace {

constexpr const TwoMomentsLimits& limits = two_moments_limits;
constexpr double reach = 0.8;  // of the visible half angle
constexpr int edge_px = 3;     // on both sides of an edge, in which it is over
constexpr int amid_px = 2;     // on both sides of the middle between two edges

// Encoded b, g, r: recorders add these.
using Value = Eigen::Vector3f;

struct BoundaryPoint {
  Eigen::Vector2d raw_px, along;  // `along`: the shaft's direction in the image
};
using Boundary = InplaceVector<BoundaryPoint, surface_lines>;  // from side to side
using Boundaries = std::array<Boundary, 4>;

Boundaries boundaries_in_image(const Scene& scene, const ShaftPose& pose, int lines) {
  Boundaries boundaries;
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return boundaries;
  const Eigen::Vector3d axis = axis_of(pose);
  for (int i = 0; i < lines; ++i) {
    const double azimuth_rad = visible_azimuth_rad(*view, reach, i, lines);
    const double tau_rad = marker_azimuth_rad(scene.marker, azimuth_rad, pose.psi_rad);
    if (!is_printed(scene.marker, tau_rad)) continue;
    const auto ends_m = boundaries_m(scene.marker, tau_rad);
    for (std::size_t k = 0; k < 4; ++k) {
      const Eigen::Vector3d point = point_on(pose, scene.marker, azimuth_rad, ends_m[k]);
      if (!scene.field.contains(point)) continue;
      const ProjectionWithJacobian image = scene.camera.raw_with_jacobian(point);
      boundaries[k].push_back({image.point_px, (image.d_px_d_point * axis).normalized()});
    }
  }
  return boundaries;
}

// The change of the image's values along the shaft at a point: means of so many pixels on both sides.
std::optional<Value> change_at(const Scene& scene, const BoundaryPoint& point, int pixels) {
  Value change = Value::Zero();
  for (int i = 1; i <= pixels; ++i)
    for (const int side : {-1, 1}) {
      const std::uint8_t* const bgr = scene.pixel_at(point.raw_px + side * i * point.along);
      if (!bgr) return std::nullopt;
      change += static_cast<float>(side) / static_cast<float>(pixels) * Value(bgr[0], bgr[1], bgr[2]);
    }
  return change;
}

// On most lines; zero where it is not seen.
Value change_of(const Scene& scene, const Boundary& boundary, int pixels) {
  std::array<InplaceVector<float, surface_lines>, 3> seen;
  for (const BoundaryPoint& point : boundary) {
    const auto change = change_at(scene, point, pixels);
    for (std::size_t c = 0; change && c < 3; ++c) seen[c].push_back((*change)[static_cast<int>(c)]);
  }
  return seen[0].empty() ? Value::Zero() : Value(median(seen[0]), median(seen[1]), median(seen[2]));
}

bool is_near(const Boundaries& boundaries, const Eigen::Vector2d& raw_px, double reach_px) {
  for (const Boundary& boundary : boundaries)
    for (std::size_t i = 1; i < boundary.size(); ++i) {
      const Eigen::Vector2d &from = boundary[i - 1].raw_px, way = boundary[i].raw_px - from;
      const double at = std::clamp((raw_px - from).dot(way) / way.squaredNorm(), 0.0, 1.0);
      if ((from + at * way - raw_px).norm() < reach_px) return true;
    }
  return false;
}

// The part of a change of values that shows at a point as well; 0 where another one shows.
float part_of(const Value& change, const Value& seen) {
  const float along = seen.dot(change), squares = seen.squaredNorm() * change.squaredNorm();
  return along > 0 && along * along > edge_limits.least_alike * squares ? along / change.squaredNorm() : 0;
}

// Where a fit has the boundaries, and what changes there.
struct FittedBoundaries {
  Boundaries places;
  std::array<Value, 4> changes;

  FittedBoundaries(const Scene& scene, const ShaftPose& pose)
      : places(boundaries_in_image(scene, pose, surface_lines)) {
    for (std::size_t k = 0; k < 4; ++k) changes[k] = change_of(scene, places[k], edge_px);
  }
};

// The change of values at other places by that at the boundaries: the median over the places that are so far away;
// nullopt where these are few.
template <class Ratio>
std::optional<float> change_at(const Scene& scene, const FittedBoundaries& fitted, const Boundaries& places,
                               double apart_px, int pixels, const Ratio& ratio) {
  InplaceVector<float, 4 * surface_lines> ratios;
  for (std::size_t k = 0; k < 4; ++k) {
    if (!(fitted.changes[k].squaredNorm() > 0)) continue;
    for (const BoundaryPoint& place : places[k])
      if (!is_near(fitted.places, place.raw_px, apart_px))
        if (const auto seen = change_at(scene, place, pixels)) ratios.push_back(ratio(fitted.changes[k], *seen));
  }
  return ratios.size() < limits.min_points ? std::nullopt : std::optional(median(ratios));
}

// Whether boundaries move so far that they could show twice, by one line.
bool moves_far(const Scene& scene, const PoseUnknowns& from, const PoseUnknowns& to) {
  const Boundaries before = boundaries_in_image(scene, from.pose(), 1),
                   after = boundaries_in_image(scene, to.pose(), 1);
  for (std::size_t k = 0; k < 4; ++k)
    if (!before[k].empty() && !after[k].empty() && (after[k][0].raw_px - before[k][0].raw_px).norm() > limits.apart_px)
      return true;
  return false;
}

// Motion blur has no place between where nothing changes.
bool shows_twice(const Scene& scene, const PoseUnknowns& pose, const FittedBoundaries& boundaries,
                 const PoseVector& step) {
  const auto moved_by = [&](double steps) {
    return boundaries_in_image(scene, pose.changed_by(steps * step).pose(), surface_lines);
  };
  const auto size_by = [](const Value& change, const Value& seen) { return seen.norm() / change.norm(); };
  const auto part = change_at(scene, boundaries, moved_by(1), limits.apart_px, edge_px, part_of);
  if (!part || *part < limits.least_part) return false;
  const auto amid = change_at(scene, boundaries, moved_by(0.5), limits.apart_px / 2, amid_px, size_by);
  return amid && *amid < limits.amid * *part;
}

}  // namespace

bool shows_two_moments(const Scene& scene, const FineFit& fit, const std::array<std::optional<ShaftPose>, 2>& before) {
  const PoseUnknowns& fitted = fit.unknowns;
  std::optional<FittedBoundaries> boundaries;
  std::optional<ShaftPose> after = fitted.pose();
  for (const auto& pose : before) {
    if (pose && after) {
      const PoseUnknowns from(*pose, fitted.through_rcm()), to(*after, fitted.through_rcm());
      const PoseVector step = from.change_to(to);
      if (moves_far(scene, from, to)) {
        if (!boundaries) boundaries.emplace(scene, fitted.pose());
        if (shows_twice(scene, fitted, *boundaries, step) || shows_twice(scene, fitted, *boundaries, -step))
          return true;
      }
    }
    after = pose;
  }
  return false;
}

}  // namespace lapservo::internal
