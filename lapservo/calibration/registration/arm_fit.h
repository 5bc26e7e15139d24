#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/fit/at_iteration.h"
#include "lapservo/calibration/marker/frame_fit.h"
#include "lapservo/calibration/registration/arm_start.h"
#include "lapservo/calibration/registration/joint_faults.h"

namespace lapservo::internal {

/// Which faults an arm's model may have beside a wrong registration.
struct ArmFaults {
  bool drift = false;                ///< what the RCM frame moves by in the camera over the recording, steadily
  std::vector<JointFault> joints{};  ///< with a size
};

/// The part of a frame's error of the roll that is the film's, the print's and the image's processing, and no noise.
inline constexpr double common_roll_part = 0.5;

/// Where a marker is seen, as its arm's joints have it.
class ArmModel {
 public:
  /// The numbers x of a fit.
  struct Blocks {
    Block rotation;     ///< about the RCM frame's axes (3), beyond the guess
    Block translation;  ///< of the RCM frame (3)
    Block offsets;      ///< of phi, rho, psi
    Block delay;
    /// Errors that all frames share, so that they do not average out: the scale of distances, the axis' tilt along the
    /// view.
    Block scale, tilt;
    Block backlash;  ///< of those joints that move
    Block drift;     ///< empty without this fault: of the RCM frame from the first pose to the last: place (3, camera
                     ///< frame), turn (3, RCM frame)
    Block joints;    ///< sizes of the joints' faults
  };

  ArmModel(const Instrument& instrument, const ArmStart& start, const JointRecording& recording,
           const ArmFaults& faults = {});

  const Blocks& blocks() const { return blocks_; }
  const std::vector<Unknown>& unknowns() const { return unknowns_; }
  /// In the middle of the recording, where it drifts.
  Rigid3 camera_from_rcm(const Eigen::VectorXd& x) const;
  Joints joints(const Eigen::VectorXd& x) const;
  std::array<double, 4> backlash_of(const Eigen::VectorXd& x) const;

  /// Off across the view (2) and along it; the axis turned in the image and tilted along the view; turned about it.
  Eigen::MatrixXd residuals(const Eigen::VectorXd& x) const;

  const std::vector<TimedPose>& poses() const { return poses_; }

 private:
  JointRecording behind_backlash(const Eigen::VectorXd& x) const;
  void add_unknowns(double delay_s, const ArmFaults& faults);
  Rigid3 camera_from_rcm_at(const Eigen::VectorXd& x, double time_s, const std::array<double, 4>& at) const;
  Eigen::Matrix<double, 6, 1> difference(const TimedPose& pose, const Rigid3& camera_from_rcm, const JointVector& q,
                                         const Eigen::VectorXd& x) const;

  Marker marker_;
  std::vector<TimedPose> poses_;
  JointRecording recording_;
  ArmGuess guess_;
  std::array<double, 4> middle_{};      ///< of the joints' motion
  Eigen::Quaterniond rcm_from_middle_;  ///< of the unrolled frame there
  std::vector<std::size_t> moving_;
  std::vector<JointFault> faults_;
  std::vector<Unknown> unknowns_;
  Blocks blocks_;
};

/// An arm's model, fitted to poses and readings.
struct ArmFit {
  ArmModel model;
  FrameFit fit;
  /// Covariance of fit.x, with the square of its displacement by faults of the readings that show.
  Eigen::MatrixXd covariance;
  Eigen::VectorXd noise;  ///< how many times the poses' own sigmas the residuals are, by channel
  /// Of the readings, that show more clearly than what frames of this quality may feign, in words; the clearest first.
  std::vector<std::string> faults;
};

/// `free`: faults that are fitted beside the registration. Nullopt where the motion leaves a number open, and where it
/// takes a backlash of half of a joint's travel.
std::optional<ArmFit> fit_arm(const Instrument& instrument, const ArmStart& start, const JointRecording& recording,
                              const ArmFaults& free, const AtIteration& at_iteration = {});

/// Why readings and poses disagree: the one fault of the readings that explains it best, in words; empty when none
/// does. `fit`: what there is without; null where there is none.
std::string explaining_fault(const Instrument& instrument, const std::vector<TimedPose>& poses,
                             const JointRecording& recording, const std::string& source, const ArmFit* fit,
                             const AtIteration& at_iteration = {});

}  // namespace lapservo::internal
