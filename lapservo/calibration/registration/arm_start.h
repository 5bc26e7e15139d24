#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/recording/joint_recording.h"
#include "lapservo/calibration/registration/timed_pose.h"
#include "lapservo/rig/joint_travel.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// The least number of poses for a registration, and the remedy where their motion is too small.
inline constexpr std::size_t min_registration_poses = 40;
inline constexpr auto swing_more =
    "swing the instrument by 0.5 rad in both directions, insert it by 20 mm and turn it, in 20 s or more";
std::string too_few_poses(std::size_t poses);

/// Where an arm stands, about: to start a fit from.
struct ArmGuess {
  Rigid3 camera_from_rcm;
  Joints joints;
  double misfit_rad = 0;                 ///< rms of the axes about it
  std::optional<std::size_t> open_sign;  ///< a joint whose other sign explains the motion about as well
};

/// The start of a fit of an arm.
struct ArmStart {
  /// Why there is none, and what to do about it: then nothing else counts. Empty when there is one.
  std::string refusal;
  /// Those that the recording covers whichever way the fit moves the delay, and the joints there.
  std::vector<TimedPose> poses;
  std::vector<std::array<double, 4>> joints;
  JointRanges ranges;  ///< of these
  ArmGuess guess;
  double delay_s = 0;
  std::vector<double> other_delays_s;  ///< explain the motion about as well
};

/// Says that other_delays_s, of which there are some, explain the motion too.
std::string ambiguous_delay(const ArmStart& start);

/// How far the clocks of frames and joints may differ, beyond the delay that the instrument has.
inline constexpr double largest_delay_s = 31;

/// Delay, signs and a first registration, whatever of them the instrument knows: refused where a joint stood still, or
/// where its sign does not show. Where the motion repeats, so that several delays explain it, it is the best one
/// near the instrument's own. Throws InputError when the recording
/// and the frames have no time in common, naming `source`.
ArmStart start_arm(const Instrument& instrument, const std::vector<TimedPose>& poses, const JointRecording& recording,
                   const std::string& source);

}  // namespace lapservo::internal
