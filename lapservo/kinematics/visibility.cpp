#include "lapservo/kinematics/visibility.h"

#include <cmath>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"

namespace lapservo::internal {

bool marker_in_view(const Camera& camera, const Marker& marker, const Rigid3& camera_from_unrolled,
                    const ViewLimits& limits) {
  constexpr double nearest_m = 0.02;
  const auto view = view_cylinder(camera_from_unrolled, marker.radius_m());
  if (!view) return false;
  const double beyond_middle_m = camera_from_unrolled.inverse().translation.z() - marker.length_m() / 2;
  if (std::abs(std::atan2(beyond_middle_m, view->camera_to_axis_m)) > limits.steepest_rad) return false;
  for (const double side : {-1.0, 0.0, 1.0})
    for (const double along_m : {0.0, marker.length_m()}) {
      const double azimuth_rad = view->facing_azimuth_rad + side * view->half_visible_rad;
      const Eigen::Vector3d point = camera_from_unrolled * surface_point(marker.radius_m(), azimuth_rad, along_m);
      if (point.z() < nearest_m || !camera.contains(camera.raw_from_point(point), limits.border_px)) return false;
      // Beyond the lens's own field raw_from_point folds back.
      if (!camera.contains(camera.ideal_from_point(point), -0.5 * camera.width_px)) return false;
    }
  return true;
}

std::optional<JointVector> random_configuration_in_view(const Camera& camera, const Marker& marker,
                                                        const Rigid3& camera_from_rcm, const ViewRange& range,
                                                        Random& random) {
  constexpr int max_attempts = 50000;
  constexpr double min_rho_m = 0.02, min_sine_phi = 0.1;  // away from the trocar, and from the singularity
  for (int attempt = 0; attempt < max_attempts; ++attempt) {
    const double v_px = random.uniform(0, camera.height_px), u_px = random.uniform(0, camera.width_px);
    const Eigen::Vector2d pixel(u_px, v_px);
    auto q = configuration_through(camera_from_rcm,
                                   camera.ray_from_ideal(pixel) * random.uniform(range.nearest_m, range.farthest_m));
    if (!q || q->rho_m < min_rho_m || std::sin(q->phi_rad) < min_sine_phi) continue;
    q->psi_rad = random.uniform(-pi, pi);
    if (marker_in_view(camera, marker, camera_from_rcm * rcm_from_unrolled(*q), range.limits)) return q;
  }
  return std::nullopt;
}

}  // namespace lapservo::internal
