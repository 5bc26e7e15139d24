#pragma once

#include <optional>

#include <Eigen/Core>

#include "lapservo/core/joint_vector.h"
#include "lapservo/geometry/rigid3.h"
#include "lapservo/marker/marker.h"

namespace lapservo {

/// Shaft axis in the RCM frame, from the RCM towards the tip.
Eigen::Vector3d shaft_axis_in_rcm(const JointVector& q);

/// The unrolled frame Rz(theta) Ry(phi), moved along the axis to the marker's proximal end: azimuths about the shaft
/// are measured in it, and points of the marker have z from 0 to its length.
Rigid3 rcm_from_unrolled(const JointVector& q);

/// The marker's frame: origin at its proximal end on the axis, z along the axis to the tip, x towards tau = 0.
Rigid3 camera_from_marker(const Marker& marker, const Rigid3& camera_from_unrolled, double psi_rad);

/// The same of a configuration.
Rigid3 camera_from_marker(const Marker& marker, const Rigid3& camera_from_rcm, const JointVector& q);

/// The configuration (psi = 0) of a shaft through the RCM whose marker begins at a point; nullopt at the RCM itself.
std::optional<JointVector> configuration_through(const Rigid3& camera_from_rcm,
                                                 const Eigen::Vector3d& proximal_end_in_camera);

/// The same of a frame there whose z is along the shaft. psi: by how much it is turned against the unrolled frame.
std::optional<JointVector> configuration_through(const Rigid3& camera_from_rcm, const Rigid3& camera_from_shaft);

/// The same of a marker's frame.
std::optional<JointVector> configuration_of_marker(const Marker& marker, const Rigid3& camera_from_rcm,
                                                   const Rigid3& seen_camera_from_marker);

}  // namespace lapservo
