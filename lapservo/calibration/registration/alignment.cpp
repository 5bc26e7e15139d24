#include "lapservo/calibration/registration/alignment.h"

#include <algorithm>

#include <fmt/format.h>

#include "lapservo/calibration/registration/arm_fit.h"
#include "lapservo/calibration/registration/arm_start.h"
#include "lapservo/calibration/registration/joint_faults.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/statistics.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/joint_conversion.h"

namespace lapservo::internal {
namespace {

// The readings of an arm whose marker is seen there; the last angle within half a turn of `read`'s.
std::optional<std::array<double, 4>> readings_at(const Marker& marker, const Rigid3& camera_from_rcm,
                                                 const Joints& joints, const TimedPose& pose,
                                                 const std::array<double, 4>& read) {
  const auto q = configuration_of_marker(marker, camera_from_rcm, pose.marker.camera_from_marker);
  if (!q) return std::nullopt;
  const Eigen::Vector4d at = joints_from_q(joints, q->vector());
  return std::array{read[0] + wrap_pi(at[0] - read[0]), at[1], at[2], read[3] + wrap_pi(at[3] - read[3])};
}

// The part of the variance of each joint's motion that the readings explain; the smallest, without the worst tenth.
double explained(const std::vector<Alignment::Pair>& pairs) {
  double least = pairs.empty() ? 0 : 1;
  for (std::size_t j = 0; j < 4; ++j) {
    double sum = 0, squares = 0;
    std::vector<double> misses;
    for (const Alignment::Pair& pair : pairs) {
      sum += pair.read[j], squares += pair.read[j] * pair.read[j];
      misses.push_back(std::abs(pair.seen[j] - pair.read[j]));
    }
    const double n = static_cast<double>(pairs.size()), variance = squares / n - sum * sum / (n * n);
    least = std::min(least, 1 - std::pow(rms_but_tenth(misses), 2) / std::max(1e-300, variance));
  }
  return least;
}

}  // namespace

Alignment align(const Instrument& instrument, const std::vector<TimedPose>& poses, const JointRecording& recording,
                const std::string& source) {
  Alignment result;
  const ArmStart start = start_arm(instrument, poses, recording, source);
  if (!start.refusal.empty()) return result.refusal = start.refusal, result;
  if (!start.other_delays_s.empty()) return result.refusal = ambiguous_delay(start), result;
  const auto fitted = fit_arm(instrument, start, recording, {false, {clock_fault(start.poses)}});
  if (!fitted) {
    const std::string fault = explaining_fault(instrument, with_focal(poses, 0), recording, source, nullptr);
    return result.refusal = fault.empty() ? std::string("the motion leaves the delay open: ") + swing_more : fault,
           result;
  }
  const auto& [model, fit, covariance, noise, faults] = *fitted;
  const Eigen::Index delay = model.blocks().delay.first, clock = model.blocks().joints.first;
  const double first_s = recording.time_s.front(), drift = fit.x[clock];
  result.shared_s = start.poses.back().time_s - start.poses.front().time_s;
  // A frame's stamp is first + (1 + drift) (t - first) + x[delay], at t by the joints' clock.
  const double middle_s = (start.poses.front().time_s + start.poses.back().time_s) / 2 - fit.x[delay];
  const double beyond_s = (middle_s - first_s) / (1 + drift);
  result.delay_s = fit.x[delay] + drift * beyond_s;
  result.sigma_delay_s = std::sqrt(covariance(delay, delay) + 2 * beyond_s * covariance(delay, clock) +
                                   beyond_s * beyond_s * covariance(clock, clock));
  result.drift_ppm = 1e6 * drift, result.sigma_drift_ppm = 1e6 * std::sqrt(covariance(clock, clock));
  const Rigid3 camera_from_rcm = model.camera_from_rcm(fit.x);
  const Joints joints = model.joints(fit.x);
  for (const TimedPose& pose : model.poses()) {
    const auto read = recording.at(first_s + (pose.time_s - fit.x[delay] - first_s) / (1 + drift));
    if (!read) continue;
    if (const auto seen = readings_at(instrument.marker, camera_from_rcm, joints, pose, *read))
      result.pairs.push_back({pose.time_s, *seen, *read});
  }
  constexpr double least_explained = 0.9;
  if (const double part = explained(result.pairs); part < least_explained)
    result.refusal = fmt::format(
        "the joints do not move as the marker does, even at the best delay ({:.2f} s): {:.0f} % of a joint's motion "
        "is explained: is it this arm's recording",
        result.delay_s, 100 * std::max(0.0, part));
  return result;
}

}  // namespace lapservo::internal
