#pragma once

#include <cmath>
#include <optional>

#include <Eigen/Core>

#include "lapservo/geometry/rigid3.h"

namespace lapservo::internal {

/// A circular cylinder as the camera sees it. Its own frame has z along the axis (distal); azimuths are measured in
/// it from x, right-handed about z.
struct CylinderView {
  double facing_azimuth_rad;  ///< gamma: azimuth of the direction from the axis to the camera centre
  double half_visible_rad;    ///< azimuths within +- this of gamma are seen; the silhouettes lie at its ends
  double camera_to_axis_m;    ///< distance of the camera centre from the axis
};

/// nullopt when the camera centre lies inside the (infinite) cylinder.
std::optional<CylinderView> view_cylinder(const Rigid3& camera_from_cylinder, double radius_m);

/// The i-th of `count` azimuths that lie evenly over the fraction `reach` of what is visible, its ends included.
inline double visible_azimuth_rad(const CylinderView& view, double reach, int i, int count) {
  const double across = count > 1 ? 2.0 * i / (count - 1) - 1 : -1;
  return view.facing_azimuth_rad + reach * view.half_visible_rad * across;
}

/// Point on the surface, in the cylinder's frame.
inline Eigen::Vector3d surface_point(double radius_m, double azimuth_rad, double along_m) {
  return {radius_m * std::cos(azimuth_rad), radius_m * std::sin(azimuth_rad), along_m};
}

}  // namespace lapservo::internal
