#include "lapservo/control/calibration_motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "lapservo/core/angles.h"
#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {

constexpr int psi = 3;

// The share of a swing's duration for fading in, and out; the shares of the rate limit for fading and for the swings.
constexpr double ease_of_swing = 0.25, share_of_easing = 0.25, share_of_swinging = 0.55;

// From 0 to 1, at rest at both ends; per duration, and its square, at most so fast.
constexpr double eased_rate = 1.875, eased_acceleration = 5.774;
double eased(double part) {
  const double t = std::clamp(part, 0.0, 1.0);
  return t * t * t * (10 - 15 * t + 6 * t * t);
}

// From 0 to `distance` at a constant rate but for `ramp_s` at both ends, where it grows linearly.
double travelled(double time_s, double distance, double rate, double ramp_s) {
  const double duration_s = distance / rate + ramp_s, t = std::clamp(time_s, 0.0, duration_s);
  if (t < ramp_s) return rate * t * t / (2 * ramp_s);
  if (t > duration_s - ramp_s) return distance - rate * (duration_s - t) * (duration_s - t) / (2 * ramp_s);
  return rate * (t - ramp_s / 2);
}

}  // namespace

Eigen::Vector4d swing_reach(const Eigen::Vector4d& start, const JointLimits& limits, double scale, double duration_s) {
  const double ease_s = ease_of_swing * duration_s;
  const Eigen::Array4d wanted = scale * Eigen::Array4d(0.25, 0.2, 0.01, 1);
  const Eigen::Array4d room = (limits.upper - start).cwiseMin(start - limits.lower).cwiseMax(0);
  return wanted.min(room)
      .min(share_of_easing * ease_s / eased_rate * limits.rate.array())
      .min(0.15 * ease_s * ease_s / eased_acceleration * limits.acceleration.array());
}

JointMotion swing_motion(const Eigen::Vector4d& start, const JointLimits& limits, double scale, double duration_s) {
  const double ease_s = ease_of_swing * duration_s;
  const Eigen::Array4d rate = limits.rate, acceleration = limits.acceleration;
  const Eigen::Array4d amplitude = swing_reach(start, limits, scale, duration_s).array().max(1e-9);
  // Shares of the acceleration limit: 0.3 for the swings, 0.15 for easing, and at most 0.33 for both together.
  const Eigen::Array4d fastest = (share_of_swinging * rate / amplitude).min((0.3 * acceleration / amplitude).sqrt());
  // All are slower by one factor: images do not distinguish joints of one frequency.
  const Eigen::Array4d wanted = two_pi / duration_s * Eigen::Array4d(3, 4, 5, 2);
  const Eigen::Array4d omega = wanted * std::min(1.0, (fastest / wanted).minCoeff());
  return {duration_s, [=](double time_s) -> Eigen::Vector4d {
            const double t = std::clamp(time_s, 0.0, duration_s);
            const double share = eased(t / ease_s) * eased((duration_s - t) / ease_s);
            return start + (share * amplitude * (t * omega).sin()).matrix();
          }};
}

JointMotion turn_motion(const Eigen::Vector4d& start, const JointLimits& limits, const std::string& source) {
  constexpr double margin_rad = 0.15, max_rate = 0.3;
  const double half_rad = std::numbers::pi + margin_rad;
  const double lowest = limits.lower[psi] + half_rad, highest = limits.upper[psi] - half_rad;
  if (lowest > highest)
    throw InputError(source, "psi", std::to_string(limits.lower[psi]) + " to " + std::to_string(limits.upper[psi]),
                     "room for a turn of " + std::to_string(2 * half_rad) + " rad");
  const double start_rad = start[psi], begin_rad = std::clamp(start_rad, lowest, highest) - half_rad;
  const double end_rad = begin_rad + 2 * half_rad;
  const double rate = std::min(max_rate, 0.5 * limits.rate[psi]), acceleration = 0.8 * limits.acceleration[psi];
  const double ramp_s = std::max(0.5, rate / acceleration), turn_s = 2 * half_rad / rate + ramp_s;
  const auto eased_s = [&](double distance) {
    return std::max({1.0, eased_rate * std::abs(distance) / (0.5 * limits.rate[psi]),
                     std::sqrt(eased_acceleration * std::abs(distance) / acceleration)});
  };
  const double to_begin_s = eased_s(begin_rad - start_rad), back_s = eased_s(start_rad - end_rad);
  return {to_begin_s + turn_s + back_s, [=](double time_s) -> Eigen::Vector4d {
            Eigen::Vector4d q = start;
            q[psi] += (begin_rad - start_rad) * eased(time_s / to_begin_s);
            q[psi] += travelled(time_s - to_begin_s, 2 * half_rad, rate, ramp_s);
            q[psi] += (start_rad - end_rad) * eased((time_s - to_begin_s - turn_s) / back_s);
            return q;
          }};
}

}  // namespace lapservo::internal
