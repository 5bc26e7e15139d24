#pragma once

#include <vector>

#include <Eigen/Core>

#include "lapservo/geometry/camera.h"
#include "lapservo/sim/scene.h"

namespace lapservo::internal {

/// Columns `begin` to `end` (exclusive) of a band of rows; empty when they meet.
struct Span {
  int begin = 0, end = 0;
  bool empty() const { return begin >= end; }
};

inline constexpr int band_rows = 16;

/// Where in the raw image a shaft can show: a span for every band of `band_rows` rows, generous by `margin_px`.
std::vector<Span> outline(const Camera& camera, double half_field_rad, const ShaftModel& model,
                          const ShaftPlacement& placement, double margin_px);

/// Widens them by what lies within a radius of the line between two points of the camera's frame.
void widen_along(std::vector<Span>& bands, const Camera& camera, double half_field_rad, const Eigen::Vector3d& from_m,
                 const Eigen::Vector3d& to_m, double radius_m, double margin_px);

/// None of an image with so many rows.
std::vector<Span> no_bands(const Camera& camera);

/// A ball's image lies within this circle; radius 0 when it isn't in the field of view.
struct Disc {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  double radius_px = 0;
};
Disc disc_around_ball(const Camera& camera, double half_field_rad, const Eigen::Vector3d& centre_in_camera,
                      double radius_m);

}  // namespace lapservo::internal
