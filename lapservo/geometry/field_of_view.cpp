#include "lapservo/geometry/field_of_view.h"

#include <algorithm>
#include <cmath>

namespace lapservo::internal {

double half_field_rad(const Camera& camera) {
  double widest = 0;
  for (const double u : {-0.5, camera.width_px - 0.5})
    for (const double v : {-0.5, camera.height_px - 0.5}) {
      const Eigen::Vector2d corner(u, v);
      const Eigen::Vector3d ray = camera.ray_from_ideal(camera.ideal_from_raw(corner).value_or(corner));
      widest = std::max(widest, std::atan(ray.head<2>().norm()));
    }
  return widest;
}

}  // namespace lapservo::internal
