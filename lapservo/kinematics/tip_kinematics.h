#pragma once

#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "lapservo/geometry/rigid3.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/marker/marker.h"

namespace lapservo::internal {

/// The configuration whose shaft, turned to psi_rad, holds the tip at a place: the one with the marker between the RCM
/// and the tip, phi from 0 to pi. Exact, also where the tip lies beside the shaft's axis. Nullopt where there is none:
/// the place is nearer to the RCM than the tip is to the marker, or beside the axis of phi, or not finite.
std::optional<JointVector> configuration_of_tip(const Rigid3& camera_from_rcm, const Marker& marker,
                                                const Eigen::Vector3d& tip_in_marker_m,
                                                const Eigen::Vector3d& tip_in_camera_m, double psi_rad);

/// The same with the psi that turns the tip as near to an orientation in the camera's frame as psi alone can.
std::optional<JointVector> configuration_of_tip(const Rigid3& camera_from_rcm, const Marker& marker,
                                                const Rigid3& marker_from_tip, const Eigen::Vector3d& tip_in_camera_m,
                                                const Eigen::Quaterniond& camera_from_tip);

}  // namespace lapservo::internal
