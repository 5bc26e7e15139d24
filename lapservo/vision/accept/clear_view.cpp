#include "lapservo/vision/accept/clear_view.h"

#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"

namespace lapservo::internal {

int lines_in_clear_view(const Scene& scene, const ShaftPose& pose, std::size_t boundary, int lines) {
  constexpr double reach = 0.9, beside_px = 4;
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return 0;
  const Eigen::Vector3d axis = pose.camera_from_unrolled.rotation * Eigen::Vector3d::UnitZ();
  int count = 0;
  for (int i = 0; i < lines; ++i) {
    const double azimuth_rad = visible_azimuth_rad(*view, reach, i, lines);
    const double tau_rad = marker_azimuth_rad(scene.marker, azimuth_rad, pose.psi_rad);
    const double along_m = boundaries_m(scene.marker, tau_rad)[boundary];
    const Eigen::Vector3d point =
        pose.camera_from_unrolled * surface_point(scene.marker.radius_m(), azimuth_rad, along_m);
    const double px_per_m = (scene.camera.raw_with_jacobian(point).d_px_d_point * axis).norm();
    const Eigen::Vector3d beside = beside_px / px_per_m * axis;
    count += (boundary == 0 || scene.is_ours(scene.class_on_shaft(point - beside))) &&
             (boundary == 3 || scene.is_ours(scene.class_on_shaft(point + beside)));
  }
  return count;
}

}  // namespace lapservo::internal
