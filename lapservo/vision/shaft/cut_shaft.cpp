#include "lapservo/vision/shaft/cut_shaft.h"

#include <algorithm>

#include "lapservo/geometry/cylinder.h"

namespace lapservo::internal {
namespace {

// Of the places along the marker, those at which a generatrix lies in the image.
int in_image(const Scene& scene, const ShaftPose& pose, double azimuth_rad) {
  constexpr int places = 8;
  int inside = 0;
  for (int i = 0; i < places; ++i) {
    const Eigen::Vector3d point =
        surface_point(scene.marker.radius_m(), azimuth_rad, scene.marker.length_m() * (i + 0.5) / places);
    inside += scene.class_on_shaft(pose.camera_from_unrolled * point) != Scene::outside;
  }
  return inside;
}

}  // namespace

bool cut_along(const Scene& scene, const ShaftPose& pose) {
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return false;
  const auto [less, more] = std::minmax({in_image(scene, pose, view->facing_azimuth_rad - view->half_visible_rad),
                                         in_image(scene, pose, view->facing_azimuth_rad + view->half_visible_rad)});
  return 4 * less <= more && more > 0;
}

}  // namespace lapservo::internal
