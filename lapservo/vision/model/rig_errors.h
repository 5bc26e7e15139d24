#pragma once

#include <array>

#include <Eigen/Core>

#include "lapservo/geometry/camera.h"
#include "lapservo/marker/marker.h"
#include "lapservo/vision/edges/edge_measurements.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// How far one sigma of each number of the rig's camera, and of the marker's length, wrap, gap and diameter, moves
/// measurements [px], to first order. Numbers count as independent of one another, but for the two focal lengths, a
/// third of whose variance is common: a camera's mostly have all of it in common, but the rig does not say. The errors
/// of a print's bands have most in common: they count as one of its length, beside what they leave of each boundary
/// (Marker::boundary_sigma_m()).
class RigErrors {
 public:
  static constexpr int of_marker = 4, most = 5 + 5 + 1 + of_marker;  ///< pinhole, distortion, response, marker
  using Shifts = Eigen::Matrix<double, most, 1>;

  RigErrors() = default;
  /// `by_exponent_px`: how far a boundary moves with the exponent of the camera's response (moved_by_exponent_px()).
  RigErrors(const Camera& camera, const Marker& marker, const ShaftPose& pose,
            const std::array<double, 4>& by_exponent_px);

  bool any() const { return camera_ != nullptr; }
  /// Zero for numbers without a sigma.
  Shifts of(const Measurement& measurement) const;

 private:
  const Camera* camera_ = nullptr;
  std::array<double, 4> response_px_{};
  /// How far length, wrap, gap and diameter move each boundary: at the print's upper edge, at its lower one.
  std::array<std::array<Eigen::Vector2d, 4>, of_marker> along_m_{};
  Eigen::Vector3d nearer_m_ = Eigen::Vector3d::Zero();  ///< by the diameter, in the unrolled frame's axes
};

/// Whether the camera or the marker has sigmas that move measurements alike.
bool has_sigmas(const Camera& camera, const Marker& marker);

}  // namespace lapservo::internal
