#pragma once

#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "lapservo/geometry/camera.h"

namespace lapservo::internal {

/// A thing within a radius of a straight line between two points of the camera's frame.
struct Capsule {
  Eigen::Vector3d from_m, to_m;
  double radius_m = 0;
};

/// Where in the raw image such things can show: parts of bands of rows, one a band, generous by `margin_px`.
std::vector<cv::Rect> outline(const Camera& camera, double half_field_rad, const std::vector<Capsule>& things,
                              double margin_px);

/// A ball's image lies within this circle; radius 0 when it isn't in the field of view.
struct Disc {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  double radius_px = 0;
};
Disc disc_around_ball(const Camera& camera, double half_field_rad, const Eigen::Vector3d& centre_in_camera,
                      double radius_m);

}  // namespace lapservo::internal
