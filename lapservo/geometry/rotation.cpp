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

Eigen::Quaterniond rotation_by(const Eigen::Vector3d& vector_rad) {
  const double angle_rad = vector_rad.norm();
  if (!(angle_rad > 0)) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, vector_rad / angle_rad));
}

Eigen::Vector3d rotation_vector_of(const Eigen::Quaterniond& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

double roll_between_rad(const Eigen::Quaterniond& from, const Eigen::Quaterniond& to) {
  const Eigen::Matrix3d turn = (from.conjugate() * to).toRotationMatrix();
  return std::atan2(turn(1, 0) - turn(0, 1), turn(0, 0) + turn(1, 1));
}

}  // namespace lapservo::internal
