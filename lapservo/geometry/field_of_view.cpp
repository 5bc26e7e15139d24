#include "lapservo/geometry/field_of_view.h"

#include <algorithm>
#include <cmath>

namespace lapservo::internal {

namespace {

// The ideal place of the farthest raw pixel with a ray on the way to a corner; short of the fold, where the inverse is
// steep.
Eigen::Vector2d farthest_ideal(const Camera& camera, const Eigen::Vector2d& corner) {
  if (const auto ideal = camera.ideal_from_raw(corner)) return *ideal;
  constexpr int halvings = 40;
  constexpr double short_of_fold = 0.99;
  const Eigen::Vector2d middle(camera.cx_px, camera.cy_px);
  const auto towards = [&](double part) { return camera.ideal_from_raw(middle + part * (corner - middle)); };
  double with_ray = 0, without = 1;
  for (int i = 0; i < halvings; ++i) {
    const double part = 0.5 * (with_ray + without);
    (towards(part) ? with_ray : without) = part;
  }
  return towards(short_of_fold * with_ray).value_or(middle);
}

}  // namespace

double half_field_rad(const Camera& camera) {
  double widest = 0;
  for (const double u : {-0.5, camera.width_px - 0.5})
    for (const double v : {-0.5, camera.height_px - 0.5}) {
      const Eigen::Vector3d ray = camera.ray_from_ideal(farthest_ideal(camera, {u, v}));
      widest = std::max(widest, std::atan(ray.head<2>().norm()));
    }
  return widest;
}

}  // namespace lapservo::internal
