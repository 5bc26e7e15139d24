#pragma once

#include <string>

#include "lapservo/geometry/rigid3.h"
#include "lapservo/rig/joint_travel.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// dVRK's camera frame: x to the left of the image, y up, z forward. measured_cp of an ECM is where it lies.
Rigid3 dvrk_from_camera();

/// Where the base frame of a dVRK PSM lies, to which its kinematics refer (modified DH of share/kinematic/PSM.json).
struct DvrkBase {
  Rigid3 camera_from_base;
  /// The largest angle between the shaft by dVRK's kinematics and by the registration, over the ranges: not 0 where
  /// joints.offset says that pitch's encoder is off.
  double worst_axis_rad = 0;
};

/// By an instrument's camera_from_rcm and joints, the best over these readings of yaw and pitch. Throws InputError
/// naming `source` for joints.sign that no PSM has: those of yaw and pitch differ, insertion's and roll's are 1.
DvrkBase dvrk_base(const Instrument& instrument, const JointRanges& ranges, const std::string& source);

/// The entry of an arm of dVRK's system.json: measured_cp is then in dVRK's camera frame, under that name. JSON.
std::string dvrk_base_frame_json(const Rigid3& camera_from_base, const std::string& reference_frame);
/// The entry of dVRK's SUJ_Fixed (suj-fixed.json) for an arm before the endoscope of an ECM: with the ECM's own
/// local/measured_cp at the time. JSON.
std::string dvrk_suj_fixed_json(const Rigid3& camera_from_base, const std::string& arm, const Rigid3& ecm_measured_cp);

}  // namespace lapservo::internal
