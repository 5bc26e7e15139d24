#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "lapservo/calibration/arm_guess.h"
#include "lapservo/calibration/frame_fit.h"
#include "lapservo/calibration/joint_recording.h"
#include "lapservo/calibration/timed_pose.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// Times sigma: what goes with the pose (the side of the marker that is seen, a codec's habits) is neither noise nor
/// common to all frames, and in no covariance. On rendered motions it doubles the errors (docs/notes/calibration.md).
inline constexpr double unmodelled_sigmas = 2;

/// Which faults an arm's model may have beside a wrong registration.
struct ArmFaults {
  bool focal = false;  ///< the camera's focal length is another: needs TimedPose::by_focal
  bool drift = false;  ///< what the RCM frame moves by in the camera over the recording, steadily
};

/// Where a marker is seen, as its arm's joints have it. The numbers x of a fit: rotation about the RCM frame's axes (3)
/// beyond the guess, its translation (3), offsets of phi, rho, psi, delay; what frames have in common and no number of
/// them averages out: the scale of distances, the axis' tilt along the view; backlash of those joints that move; then
/// the faults: relative change of the focal length; translation (3, camera frame) and rotation (3, RCM frame) of the
/// RCM frame from the first pose to the last.
class ArmModel {
 public:
  static constexpr Eigen::Index rotation = 0, translation = 3, offsets = 6, delay = 9, scale = 10, tilt = 11,
                                backlash = 12;

  ArmModel(const Instrument& instrument, std::vector<TimedPose> poses, const JointRecording& recording,
           const ArmGuess& guess, const ArmFaults& faults = {});

  std::vector<Unknown> unknowns(double delay_s) const;
  /// In the middle of the recording, where it drifts.
  Rigid3 camera_from_rcm(const Eigen::VectorXd& x) const;
  Joints joints(const Eigen::VectorXd& x) const;
  std::array<double, 4> backlash_of(const Eigen::VectorXd& x) const;
  /// Places in x of the faults that were asked for.
  Eigen::Index focal() const { return backlash + static_cast<Eigen::Index>(moving_.size()); }
  Eigen::Index drift() const { return focal() + (faults_.focal ? 1 : 0); }

  /// Off across the view (2) and along it; the axis turned in the picture and tilted along the view; turned about it.
  Eigen::MatrixXd residuals(const Eigen::VectorXd& x) const;

  const std::vector<TimedPose>& poses() const { return poses_; }

 private:
  JointRecording behind_backlash(const Eigen::VectorXd& x) const;
  Rigid3 camera_from_rcm_at(const Eigen::VectorXd& x, double time_s) const;
  Eigen::Matrix<double, 6, 1> difference(const TimedPose& pose, const Rigid3& camera_from_rcm, const JointVector& q,
                                         const Eigen::VectorXd& x) const;

  Marker marker_;
  std::vector<TimedPose> poses_;
  JointRecording recording_;
  ArmGuess guess_;
  ArmFaults faults_;
  std::vector<std::size_t> moving_;
};

}  // namespace lapservo::internal
