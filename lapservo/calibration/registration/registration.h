#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/fit/at_iteration.h"
#include "lapservo/calibration/recording/joint_recording.h"
#include "lapservo/calibration/registration/timed_pose.h"
#include "lapservo/rig/joint_travel.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// The residual at one frame: the marker as measured relative to its place by the registration.
struct RegistrationResidual {
  double time_s;
  double position_m, axis_rad, roll_rad;  ///< sizes; with joints all three, else how far the axis misses the RCM
};

/// Where an arm stands before its camera. Sigmas are one standard deviation.
struct Registration {
  /// Why there is none, and what to do about it: then nothing else counts. Empty when there is one.
  std::string refusal;
  Rigid3 camera_from_rcm;
  Eigen::Vector3d sigma_translation_m = Eigen::Vector3d::Zero();
  /// Sigmas of x y z w; nullopt where the rotation is a convention or the rig's.
  std::optional<Eigen::Vector4d> sigma_quaternion;
  double sigma_rotation_rad = 0;  ///< of the angle of a rotation between the true one and this

  /// With joint readings.
  struct Arm {
    Joints joints;
    std::array<double, 4> sigma_offset{};  ///< 0: the rig's own, which camera_from_rcm absorbs
    double image_delay_s = 0, sigma_image_delay_s = 0;
    std::array<double, 4> backlash{};  ///< between joint readings and instrument, rad and m
    JointRanges ranges{};              ///< of the joints' readings
    /// Covariance of a rotation of camera_from_rcm about its own axes (3), of its translation (3), of the offsets of
    /// phi, rho, psi.
    Eigen::Matrix<double, 9, 9> covariance = Eigen::Matrix<double, 9, 9>::Zero();
  };
  std::optional<Arm> arm;

  /// Faults of the poses and the joints' readings that show beyond the noise, one sentence each: the sigmas count them.
  /// They count those, too, that frames of this quality may feign; these are not among them.
  std::vector<std::string> faults;
  std::vector<std::string> unknown;  ///< quantities that these data do not determine, one sentence each
  std::vector<RegistrationResidual> residuals;
};

/// By how much a registration may put the marker off, one sigma: its place, its axis' direction, its turn about that.
struct MarkerPlacementSigma {
  double place_m = 0, axis_rad = 0, roll_rad = 0;
};
/// At readings of the joints, within what they moved by or beyond. Needs Registration::arm.
MarkerPlacementSigma placement_sigma(const Marker& marker, const Registration& registration,
                                     const std::array<double, 4>& readings);
/// The largest over the corners of what the joints moved by, widened to all sides by so much.
MarkerPlacementSigma placement_sigma_beyond(const Marker& marker, const Registration& registration, double beyond_rad,
                                            double beyond_m);

/// From the poses alone: where the RCM is. The rotation stays the rig's; where it has none, x points along the mean
/// shaft and z up in the image, so that phi is near a right angle.
Registration register_rcm(const Instrument& instrument, const std::vector<TimedPose>& poses,
                          const AtIteration& at_iteration = {});

/// camera_from_rcm, joints.sign, joints.offset and image_delay_s, with the backlash between readings and instrument,
/// whatever of them the instrument knows; its `joints` names the columns. Refused where a joint stood still, and where
/// poses and joints disagree by more than a registration may be off, with the fault that explains it. theta's
/// offset stays the rig's, and of the two ways to turn the RCM frame (z up or down, with the signs of theta and phi)
/// that nearer to the rig's camera_from_rcm, else that of its theta's sign. Throws InputError when the recording and
/// the frames have no time in common, naming `source`.
Registration register_arm(const Instrument& instrument, const std::vector<TimedPose>& poses,
                          const JointRecording& recording, const std::string& source,
                          const AtIteration& at_iteration = {});

}  // namespace lapservo::internal
