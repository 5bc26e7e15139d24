#include "lapservo/calibration/registration/arm_start.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "lapservo/calibration/registration/axes_meeting_point.h"
#include "lapservo/calibration/registration/delay_search.h"
#include "lapservo/core/error.h"
#include "lapservo/core/statistics.h"

namespace lapservo::internal {
namespace {

// Clocks that are set by the network, with a delay of the images.
constexpr double usual_delay_s = 3.2;

// Frames that the recording covers whichever way the fit moves the delay, and the joints there.
void keep_common(const std::vector<TimedPose>& poses, const JointRecording& recording, ArmStart& start) {
  constexpr double margin_s = 0.1;
  for (const TimedPose& pose : poses) {
    const double time_s = pose.time_s - start.delay_s;
    const auto at = recording.at(time_s);
    if (!at || !recording.at(time_s - margin_s) || !recording.at(time_s + margin_s)) continue;
    start.poses.push_back(pose), start.joints.push_back(*at);
  }
}

void refuse_apart(const std::vector<TimedPose>& poses, const JointRecording& recording, double about_s,
                  const std::string& source) {
  const double first_s = poses.front().time_s - about_s, last_s = poses.back().time_s - about_s;
  const double shared_s = std::min(last_s, recording.time_s.back()) - std::max(first_s, recording.time_s.front());
  if (shared_s > -largest_delay_s) return;
  throw InputError(source,
                   fmt::format("has no time in common with the frames: they run from {:.2f} to {:.2f} s, it from "
                               "{:.2f} to {:.2f} s; subtract what time_s has more, so that both begin within {:.0f} s",
                               first_s, last_s, recording.time_s.front(), recording.time_s.back(), largest_delay_s));
}

std::string clocks_text(const std::vector<TimedPose>& poses, const JointRecording& recording) {
  const double frames_s = poses.back().time_s - poses.front().time_s,
               joints_s = recording.time_s.back() - recording.time_s.front();
  return fmt::format("frames from {:.1f} to {:.1f} s, joints from {:.1f} to {:.1f} s{}", poses.front().time_s,
                     poses.back().time_s, recording.time_s.front(), recording.time_s.back(),
                     joints_s > 100 * frames_s ? ": time_s looks like milliseconds" : "");
}

}  // namespace

std::string too_few_poses(std::size_t poses) {
  return fmt::format("the marker was found in {} frames, at least {} are needed", poses, min_registration_poses);
}

std::string ambiguous_delay(const ArmStart& start) {
  return fmt::format(
      "the motion repeats: at a delay of {:.2f} s the joints explain it about as well as at {:.2f} s: swing "
      "irregularly, "
      "or cut both recordings to less than a period",
      start.other_delays_s.front(), start.delay_s);
}

ArmStart start_arm(const Instrument& instrument, const std::vector<TimedPose>& poses, const JointRecording& recording,
                   const std::string& source) {
  ArmStart start;
  if (poses.size() < min_registration_poses) return start.refusal = too_few_poses(poses.size()), start;
  const double about_s = instrument.image_delay_s.value_or(0);
  refuse_apart(poses, recording, about_s, source);
  const Joints& joints = instrument.joints.value();
  if (const std::string still = still_joints(joints, ranges_of(recording.joints)); !still.empty())
    return start.refusal = still + ": " + swing_more, start;
  const auto meeting = axes_meeting_point(poses);
  if (!meeting)
    return start.refusal = std::string("the shaft's axes are too alike to locate their intersection: ") + swing_more,
           start;
  std::vector<double> rho_m;
  for (const TimedPose& pose : poses) rho_m.push_back(pose.beyond_m(meeting->point_m));

  if (median(std::vector(rho_m)) < 0) return start.refusal = reversed_marker, start;

  constexpr double least_explained = 0.5, max_misfit_rad = 0.1;
  const auto foreign = [&](const std::string& how) {
    start.refusal = fmt::format(
        "the joints do not move as the marker does ({}): is it this arm's recording, are names in the order theta, "
        "phi, "
        "rho, psi, do both clocks run within 30 s of each other ({})",
        how, clocks_text(poses, recording));
    return start;
  };
  std::vector<DelayMatch> matches = search_delay(poses, rho_m, recording, about_s, largest_delay_s);
  if (matches.empty() || matches.front().explained < least_explained)
    return foreign(
        fmt::format("{:.0f} % of the motion is explained", matches.empty() ? 0 : 100 * matches.front().explained));
  std::stable_partition(matches.begin(), matches.end(),
                        [&](const DelayMatch& match) { return std::abs(match.delay_s - about_s) <= usual_delay_s; });
  const DelayMatch& match = matches.front();
  start.delay_s = match.delay_s;
  for (auto other = matches.begin() + 1; other != matches.end(); ++other)
    start.other_delays_s.push_back(other->delay_s);
  if (!start.other_delays_s.empty() && std::abs(start.delay_s - about_s) > usual_delay_s)
    return start.refusal = ambiguous_delay(start), start;
  keep_common(poses, recording, start);
  if (start.poses.size() < min_registration_poses)
    return start.refusal = fmt::format("{} frames lie within the recording of the joints, at least {} are needed",
                                       start.poses.size(), min_registration_poses),
           start;
  start.ranges = ranges_of(start.joints);
  if (const std::string still = still_joints(joints, start.ranges); !still.empty())
    return start.refusal = "while the marker is seen, " + still + ": " + swing_more, start;
  start.guess = guess_arm(instrument, start.poses, start.joints, meeting->point_m, match.rho_per_joint);
  if (start.guess.misfit_rad > max_misfit_rad)
    return foreign(fmt::format("axes miss by {:.2f} rad", start.guess.misfit_rad));
  if (const auto open = start.guess.open_sign)
    return start.refusal = fmt::format("both signs of {} explain the motion ({}): move it independently of the others",
                                       joints.names[*open], travels_text(joints, start.ranges)),
           start;
  return start;
}

}  // namespace lapservo::internal
