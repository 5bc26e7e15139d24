#include "lapservo/vision/accept/clear_view.h"

#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"

namespace lapservo::internal {
namespace {

// In the image along the shaft, about where it lies on the marker.
double along_px_per_m(const Scene& scene, const ShaftPose& pose, double azimuth_rad, double along_m) {
  constexpr double step_m = 0.5e-3;
  const auto px = [&](double at_m) {
    return scene.camera.raw_from_point(pose.camera_from_unrolled *
                                       surface_point(scene.marker.radius_m(), azimuth_rad, at_m));
  };
  return (px(along_m + step_m) - px(along_m - step_m)).norm() / (2 * step_m);
}

}  // namespace

int lines_in_clear_view(const Scene& scene, const ShaftPose& pose, std::size_t boundary, int lines) {
  constexpr double reach = 0.9, beside_px = 4;
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return 0;
  int count = 0;
  for (int i = 0; i < lines; ++i) {
    const double azimuth_rad = visible_azimuth_rad(*view, reach, i, lines);
    const double tau_rad = marker_azimuth_rad(scene.marker, azimuth_rad, pose.psi_rad);
    const double along_m = boundaries_m(scene.marker, tau_rad)[boundary];
    const double beside_m = beside_px / along_px_per_m(scene, pose, azimuth_rad, along_m);
    const auto shows_marker = [&](double at_m) {
      return scene.is_ours(
          scene.class_on_shaft(pose.camera_from_unrolled * surface_point(scene.marker.radius_m(), azimuth_rad, at_m)));
    };
    count += (boundary == 0 || shows_marker(along_m - beside_m)) && (boundary == 3 || shows_marker(along_m + beside_m));
  }
  return count;
}

}  // namespace lapservo::internal
