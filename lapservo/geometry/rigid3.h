#pragma once

#include <Eigen/Geometry>

namespace lapservo {

/// Rigid transform; `a_from_b * point_in_b` is the point in a, and `a_from_b * b_from_c` is a_from_c. Metres.
struct Rigid3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  bool operator==(const Rigid3&) const = default;
  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const { return rotation * point + translation; }
  Rigid3 operator*(const Rigid3& other) const { return {rotation * other.rotation, *this * other.translation}; }
  Rigid3 inverse() const {
    const Eigen::Quaterniond back = rotation.conjugate();
    return {back, -(back * translation)};
  }
};

}  // namespace lapservo
