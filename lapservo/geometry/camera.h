#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "lapservo/geometry/response.h"

namespace lapservo {

/// A point of the image plane and how it moves: d(u, v)/d(x, y, z) at a point in the camera frame, pixels per metre.
struct ProjectionWithJacobian {
  Eigen::Vector2d point_px;
  Eigen::Matrix<double, 2, 3> d_px_d_point;
};

/// Lateral chromatic aberration: how much larger than green's a channel's raw image is, about the principal point.
struct ChromaticAberration {
  double blue = 1, red = 1;
  bool operator==(const ChromaticAberration&) const = default;
};

/// One standard deviation of each number of a camera, in its units; 0 for what was not measured.
struct CameraSigmas {
  double fx_px = 0, fy_px = 0, cx_px = 0, cy_px = 0;
  std::array<double, 5> distortion{};
  double blue = 0, red = 0;  ///< of the lateral chromatic aberration
  bool operator==(const CameraSigmas&) const = default;
};

/// Pinhole camera with plumb_bob distortion (k1 k2 p1 p2 k3), as in a ROS camera_info. Pixel centres lie at integer
/// coordinates. Raw pixels are those of the image; ideal pixels are undistorted with the same camera matrix.
struct Camera {
  int width_px = 0;
  int height_px = 0;
  double fx_px = 0, fy_px = 0, cx_px = 0, cy_px = 0;
  std::array<double, 5> distortion{};  ///< k1 k2 p1 p2 k3
  Response response;
  bool deinterlace = false;  ///< its frames are two fields, of two moments
  /// From the exposure of the first row to that of the last, at a frame's time that of the middle; 0: a global shutter.
  double readout_s = 0;
  static constexpr double longest_readout_s = 0.1;
  ChromaticAberration chromatic_aberration = {};
  CameraSigmas sigmas = {};
  /// That of fx fy cx cy [px] k1 k2 p1 p2 k3. Without it `sigmas` count as independent, but for a third of the focal
  /// lengths' variance: mostly they have all of it in common, but the rig does not say.
  std::optional<Eigen::Matrix<double, 9, 9>> covariance = {};
  /// `covariance`, or what the sigmas say of it.
  Eigen::Matrix<double, 9, 9> known_covariance() const;

  bool operator==(const Camera&) const = default;
  bool distorted() const {
    int some = 0;  // evaluated for every sample: no branches
    for (const double k : distortion) some |= static_cast<int>(k != 0);
    return some != 0;
  }
  bool contains(const Eigen::Vector2d& raw_px, double margin_px = 0) const;
  /// When a row is exposed, after the frame's time.
  double exposed_after_s(double row_px) const { return readout_s * ((row_px + 0.5) / height_px - 0.5); }

  /// Pinhole image of a point in the camera frame; only for z > 0 (behind the camera it mirrors).
  Eigen::Vector2d ideal_from_point(const Eigen::Vector3d& point_in_camera) const {
    const double inverse_z = 1 / point_in_camera.z();
    return {cx_px + fx_px * point_in_camera.x() * inverse_z, cy_px + fy_px * point_in_camera.y() * inverse_z};
  }
  Eigen::Vector2d raw_from_ideal(const Eigen::Vector2d& ideal_px) const {
    return distorted() ? distorted_from_ideal(ideal_px) : ideal_px;
  }
  /// Newton's method; nullopt where the distortion can't be inverted (far outside the image of a barrel lens).
  std::optional<Eigen::Vector2d> ideal_from_raw(const Eigen::Vector2d& raw_px) const;
  Eigen::Vector2d raw_from_point(const Eigen::Vector3d& point_in_camera) const {
    return raw_from_ideal(ideal_from_point(point_in_camera));
  }
  /// raw_from_point with its derivative.
  ProjectionWithJacobian raw_with_jacobian(const Eigen::Vector3d& point_in_camera) const;
  /// ideal_from_point with its derivative.
  ProjectionWithJacobian ideal_with_jacobian(const Eigen::Vector3d& point_in_camera) const;
  /// Direction (not normalised, z = 1) of the ray through an ideal pixel.
  Eigen::Vector3d ray_from_ideal(const Eigen::Vector2d& ideal_px) const;

 private:
  Eigen::Vector2d distorted_from_ideal(const Eigen::Vector2d& ideal_px) const;
};

}  // namespace lapservo
