#include "lapservo/vision/shaft/sampled_surface.h"

namespace lapservo::internal {

SampledSurface::SampledSurface(const Scene& scene, const ShaftPose& pose, const CylinderView& view, double beyond_m)
    : first_m(-beyond_m), step_m((scene.marker.length_m() + 2 * beyond_m) / samples_along) {
  const Eigen::Vector3d step = pose.camera_from_unrolled.rotation * Eigen::Vector3d(0, 0, step_m);
  for (int i = 0; i < line_count; ++i) {
    Line& line = lines[static_cast<std::size_t>(i)];
    line.azimuth_rad = visible_azimuth_rad(view, reach, i, line_count);
    const LineInImage<samples_along> places(
        scene, pose.camera_from_unrolled * surface_point(scene.marker.radius_m(), line.azimuth_rad, first_m), step);
    for (std::size_t k = 0; k < samples_along; ++k) {
      const std::uint8_t* const bgr = places.pixel(k, true);
      line.classes[k] = bgr ? scene.classes(bgr) : Scene::outside;
    }
  }
}

}  // namespace lapservo::internal
