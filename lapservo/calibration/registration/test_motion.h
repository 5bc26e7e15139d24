#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Geometry>

#include "lapservo/calibration/recording/joint_recording.h"
#include "lapservo/calibration/registration/timed_pose.h"
#include "lapservo/core/random.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/backlash.h"
#include "lapservo/testing/rigs.h"

/// Recordings of an arm for tests of the registration.
namespace lapservo::internal {

// An arm in smooth motion, its joints read at 100 Hz, its marker seen 30 times a second with the noise that its sigmas
// say.
struct Motion {
  double seconds = 20, delay_s = 0.08;
  double joints_from_s = 0;                 // when the recording of the joints begins, and its clock
  double drift = 0;                         // how much faster the frames' clock runs
  std::array<double, 4> swing{1, 1, 1, 1};  // of each joint's usual one
  double common_turn_rad = 0;               // of all frames: the film's and the print's
  std::array<double, 4> sign{1, -1, 1, -1}, offset{0.2, 1.5, -0.02, 0.7}, backlash{};
  std::uint64_t seed = 1;
  std::function<double(std::size_t joint, double t)> wave{};  // within -1 and 1; else a sine
};

struct Recorded {
  Instrument truth;
  std::vector<TimedPose> poses;
  JointRecording recording;
};

inline JointVector motion_at(double t, const Motion& motion) {
  const double p = 0.3 * static_cast<double>(motion.seed);
  const std::array<double, 4> rates{0.9, 1.3, 0.7, 0.8}, phases{p, 2 * p, 3 * p, p};
  const auto at = [&](std::size_t j) {
    return motion.swing[j] * (motion.wave ? motion.wave(j, t) : std::sin(rates[j] * t + phases[j]));
  };
  return {0.2 + 0.35 * at(0), 1.45 + 0.25 * at(1), 0.11 + 0.02 * at(2), 1.2 * at(3)};
}

inline Recorded recorded(const Motion& motion) {
  Recorded result;
  result.truth = testing::paper_test_rig().instruments[0];
  result.truth.joints = Joints{{"yaw", "pitch", "insertion", "roll"}, motion.sign, motion.offset};
  const Joints& joints = *result.truth.joints;
  Random random(motion.seed);
  std::array<Backlash, 4> gaps;
  constexpr double dt = 1e-3;
  const int count = static_cast<int>(motion.seconds / dt), begin = static_cast<int>(motion.joints_from_s / dt);
  result.truth.image_delay_s = motion.delay_s + begin * dt;
  for (int i = std::min(0, begin); i < count + std::max(0, begin); ++i) {
    const Eigen::Vector4d q = motion_at(i * dt, motion).vector();
    std::array<double, 4> reading, shaft;
    for (std::size_t j = 0; j < 4; ++j) {
      reading[j] = (q[static_cast<Eigen::Index>(j)] - joints.offset[j]) / joints.sign[j];
      if (i == std::min(0, begin)) gaps[j] = Backlash(reading[j]);
      gaps[j].follow(reading[j], motion.backlash[j]);
      shaft[j] = joints.sign[j] * gaps[j].instrument(motion.backlash[j]) + joints.offset[j];
    }
    if (i >= begin && i < begin + count && (i - begin) % 10 == 0)
      result.recording.time_s.push_back((i - begin) * dt), result.recording.joints.push_back(reading);
    if (i < 0 || i >= count || i % 33 != 0) continue;
    const Rigid3 exact = camera_from_marker(
        result.truth.marker,
        *result.truth.camera_from_rcm * rcm_from_unrolled({shaft[0], shaft[1], shaft[2], shaft[3]}), shaft[3]);
    TimedPose pose;
    pose.time_s = i * dt * (1 + motion.drift) + motion.delay_s;
    Observation::MarkerPose& seen = pose.marker;
    seen.sigma_xy_m = 1e-5, seen.sigma_z_m = 1e-4, seen.sigma_axis_rad = 1e-3, seen.sigma_roll_rad = 1e-3;
    const Eigen::Vector3d ray = exact.translation.normalized(), side = ray.unitOrthogonal();
    const auto n = [&] { return random.normal(); };
    seen.camera_from_marker.translation =
        exact.translation + 1e-4 * n() * ray + 1e-5 * (n() * side + n() * ray.cross(side));
    const Eigen::Vector3d turn(7e-4 * n(), 7e-4 * n(), 1e-3 * n() + motion.common_turn_rad);
    seen.camera_from_marker.rotation = exact.rotation * Eigen::AngleAxisd(turn.norm(), turn.normalized());
    result.poses.push_back(pose);
  }
  return result;
}

// A user's joints: names only.
inline Instrument with_names_only(Instrument instrument) {
  const double theta_offset = instrument.joints->offset[0];
  instrument.camera_from_rcm.reset(), instrument.image_delay_s.reset();
  instrument.joints->sign = {instrument.joints->sign[0], 1, 1, 1};
  instrument.joints->offset = {theta_offset, 0, 0, 0};
  return instrument;
}

// Sines of three rates each, which do not repeat.
inline std::function<double(std::size_t, double)> irregular(std::uint64_t seed) {
  Random random(1000 + seed);
  std::array<std::array<double, 6>, 4> numbers;
  for (auto& of_joint : numbers)
    for (std::size_t k = 0; k < 6; ++k) of_joint[k] = k < 3 ? random.uniform(0.4, 1.6) : random.uniform(0, 6.28);
  return [numbers](std::size_t j, double t) {
    double sum = 0;
    for (std::size_t k = 0; k < 3; ++k) sum += std::sin(numbers[j][k] * t + numbers[j][k + 3]) / 2;
    return sum;
  };
}

}  // namespace lapservo::internal
