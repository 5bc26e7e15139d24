#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "lapservo/calibration/recording/joint_recording.h"
#include "lapservo/calibration/registration/timed_pose.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// Where an arm stands, about: to start a fit from.
struct ArmGuess {
  Rigid3 camera_from_rcm;
  Joints joints;
  double misfit_rad = 0;                 ///< rms of the axes about it
  std::optional<std::size_t> open_sign;  ///< a joint whose other sign explains the motion about as well
};

/// Signs, offsets and rotation by the axes and rolls of poses whose joints are known; `rcm_m`: the intersection of the
/// axes. Among equal descriptions it returns that which register_arm() promises.
ArmGuess guess_arm(const Instrument& instrument, const std::vector<TimedPose>& poses,
                   const std::vector<std::array<double, 4>>& joints, const Eigen::Vector3d& rcm_m,
                   double rho_per_joint);

}  // namespace lapservo::internal
