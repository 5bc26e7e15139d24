#include "lapservo/geometry/rotation.h"

#include <algorithm>
#include <cmath>

namespace lapservo::internal {

Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  constexpr double nearly_opposite = -1 + 1e-12;
  const Eigen::Vector3d a = from.normalized(), b = to.normalized();
  const double cosine = std::clamp(a.dot(b), -1.0, 1.0);
  Eigen::Quaterniond rotation;
  if (cosine > nearly_opposite) {
    const double twice_w = std::sqrt(2 * (1 + cosine));
    rotation.vec() = a.cross(b) / twice_w;
    rotation.w() = twice_w / 2;
  } else {  // half a turn about any axis that is perpendicular to both
    rotation.vec() = a.unitOrthogonal();
    rotation.w() = 0;
  }
  return rotation.normalized();
}

}  // namespace lapservo::internal
