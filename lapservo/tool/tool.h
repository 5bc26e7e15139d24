#pragma once

#include <cstddef>
#include <filesystem>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lapservo/geometry/rigid3.h"

namespace lapservo {

/// A revolute joint of a wrist by its row of modified Denavit-Hartenberg parameters (Craig's convention, which dVRK
/// has): previous_from_joint = Rx(alpha) Tx(a) Rz(theta + reading + offset) Tz(d).
struct WristJoint {
  /// A reading of a cable-driven wrist comes from an encoder at the motor, half a metre of cable and pulleys away, and
  /// cables stretch with load and stick by friction: it is off by about 1 degree in use, and by more under force.
  static constexpr double cable_driven_sigma_rad = std::numbers::pi / 180;

  std::string name;  ///< as measured_js, a bag or a CSV of joints has it
  double alpha_rad = 0, a_m = 0, theta_rad = 0, d_m = 0;
  double offset_rad = 0;                              ///< measured: what is added to each reading
  double sigma_reading_rad = cable_driven_sigma_rad;  ///< one standard deviation of a reading, offset removed
  bool operator==(const WristJoint&) const = default;
};

/// Where a tool's base lies in the marker's frame (origin at the proximal end on the axis, z along the axis to the tip,
/// x towards tau = 0); its z is the marker's.
struct ToolPlace {
  static constexpr std::size_t max_wrist_joints = 4;
  /// Order: base_in_marker_m [m], azimuth_rad, the wrist joints' offset_rad [rad]; zero where exact.
  using Covariance = Eigen::Matrix<double, 4 + max_wrist_joints, 4 + max_wrist_joints>;

  Eigen::Vector3d base_in_marker_m = Eigen::Vector3d::Zero();
  double azimuth_rad = 0;  ///< of the base's x axis from tau = 0, right-handed about z; 0 for a straight tool
  Covariance covariance = Covariance::Zero();
  bool operator==(const ToolPlace&) const = default;
};

/// A tool behind an instrument's marker. Its base is the tip itself for a straight tool; for a wrist the frame in which
/// the first joint's row stands (dVRK's frame after `roll`: z along the shaft, the first wrist axis is its y).
struct Tool {
  static constexpr std::size_t max_wrist_joints = ToolPlace::max_wrist_joints;
  using Place = ToolPlace;  // not nested: Clang makes no optional of a nested class with defaults within its outer one
  using PlaceCovariance = ToolPlace::Covariance;

  std::vector<WristJoint> wrist;  ///< proximal to distal; none: straight
  Rigid3 last_from_tip;           ///< the tip in the frame of the last joint, or of the base
  bool snake_like = false;     ///< first and last joint are one reading, halved, and so are those between, as in dVRK
  std::optional<Place> place;  ///< nullopt until it is measured: then there is no tip
  std::filesystem::path file;  ///< where the wrist was read from, when it has a file of its own
  bool operator==(const Tool&) const = default;
};

/// The tip in the marker's frame.
struct TipInMarker {
  /// Order: position [m], rotation vector about the marker's axes [rad].
  using Covariance = Eigen::Matrix<double, 6, 6>;

  Rigid3 marker_from_tip;
  Eigen::Matrix3d covariance_m2 = Eigen::Matrix3d::Zero();  ///< of the position, marker's axes: that of both parts
  Covariance of_place = Covariance::Zero();                 ///< by Tool::Place: where the tool sits, joints' offsets
  Covariance of_readings = Covariance::Zero();              ///< by the readings of the wrist's joints
};

/// The tip by readings of the wrist's joints, in the order of Tool::wrist, none for a straight tool. Allocates nothing.
/// Throws InputError for a tool without a place, another count of readings and a reading that is not finite.
TipInMarker tip_in_marker(const Tool& tool, std::span<const double> wrist_rad);

/// Covariance of the tip in the camera's axes, position [m], then rotation vector [rad]: by the pose of the marker,
/// with its covariance in the same order and axes, and by both parts of the tip's.
TipInMarker::Covariance tip_covariance_in_camera(const Rigid3& camera_from_marker,
                                                 const TipInMarker::Covariance& marker_covariance,
                                                 const TipInMarker& tip);

}  // namespace lapservo
