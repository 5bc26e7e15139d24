#include "lapservo/geometry/cylinder.h"

#include <cmath>

namespace lapservo::internal {

std::optional<CylinderView> view_cylinder(const Rigid3& camera_from_cylinder, double radius_m) {
  const Eigen::Vector3d camera_in_cylinder = camera_from_cylinder.inverse().translation;
  const double distance_m = camera_in_cylinder.head<2>().norm();
  if (!(distance_m > radius_m)) return std::nullopt;
  return CylinderView{std::atan2(camera_in_cylinder.y(), camera_in_cylinder.x()), std::acos(radius_m / distance_m),
                      distance_m};
}

}  // namespace lapservo::internal
