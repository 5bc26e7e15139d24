#pragma once

#include <cmath>

#include <Eigen/Core>

#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/field_of_view.h"

namespace lapservo::internal {

/// Which points a camera can show: those before it, hardly farther from its axis than the image's corners, or than
/// where its distortion folds before them. Beyond, the model of the distortion folds places back into the image.
class LensField {
 public:
  static constexpr double nearest_m = 1e-3;  ///< to the camera, along its axis

  explicit LensField(const Camera& camera) {
    const double beyond_corner = is_invertible_everywhere(camera) ? 1.1 : 1;
    const double widest = beyond_corner * std::tan(half_field_rad(camera));
    widest_squared_ = widest * widest;
  }
  /// For a point in the camera's frame, or a ray to it.
  bool contains(const Eigen::Vector3d& point) const {
    return point.z() > nearest_m && point.head<2>().squaredNorm() < widest_squared_ * point.z() * point.z();
  }

 private:
  double widest_squared_;
};

}  // namespace lapservo::internal
