#pragma once

#include <limits>
#include <optional>
#include <string>

#include <Eigen/Core>

#include "lapservo/control/control_step.h"
#include "lapservo/control/controller_config.h"
#include "lapservo/control/velocity_qp.h"
#include "lapservo/robot/joint_path.h"

namespace lapservo::internal {

/// The end points now and how they move.
struct EndPoints {
  Eigen::Vector4d ends_px = Eigen::Vector4d::Zero();
  Eigen::Matrix4d jacobian = Eigen::Matrix4d::Zero();
};

/// Bounds of position, by PositionLimit::of; those of the marker's ends are infinite without a window.
struct PositionBounds {
  Eigen::Matrix<double, 8, 1> lower, upper;
  PositionBounds(const JointLimits& limits, const std::optional<ImageWindow>& window);
  /// "limits.upper rho_m 0.2", "field of view: least e3_v_px 20".
  std::string text(const PositionLimit& limit) const;
};

/// The part of a motion that reached bounds allow.
struct Stop {
  Eigen::Vector4d left = Eigen::Vector4d::Zero();  ///< of the velocity
  std::optional<PositionLimit> at{};               ///< the bound that takes most of it; nullopt where none takes any
};
/// Bounds are reached within a hundredth of a joint's scale, or a pixel. `left` is nearest to `wanted` in the norm of
/// `weight`; rates and accelerations do not count.
Stop stop_at(const PositionBounds& bounds, const Scales& scales, const Eigen::Vector4d& position, const EndPoints& ends,
             const Eigen::Vector4d& wanted, const Eigen::Matrix4d& weight);

/// Time that stopping never takes longer than: the largest rate / acceleration of a joint.
double stopping_time_s(const JointLimits& limits);

/// The velocity after `period_s` of braking all joints in step: the direction stays, and the slowest joint to stop uses
/// its whole acceleration.
Eigen::Vector4d brake(const JointLimits& limits, const Eigen::Vector4d& velocity, double period_s);

/// Velocities that are allowed besides: lower <= v' <= upper.
struct VelocityRange {
  Eigen::Vector4d lower = Eigen::Vector4d::Constant(-std::numeric_limits<double>::infinity()), upper = -lower;
};

struct LimitedVelocity {
  Eigen::Vector4d velocity = Eigen::Vector4d::Zero();
  bool limited = false;  ///< it is not the one wanted
};

/// The velocity at the end of the coming period, which ramps linearly to it, that is nearest to `wanted` in the norm of
/// `weight` and obeys rate, acceleration and position limits and the image window. Position limits of `ends` are left
/// out when there are none. It lies in `range`, or as near to it as the limits allow.
///
/// Why nothing is ever crossed. Let t_s <= t_m = stopping_time_s be the time that stopping from the velocity v takes, T
/// the coming period (T <= 2 t_m), and let x be any bounded quantity with gap g = bound - x and speed w towards the
/// bound: a joint's, or a linear function of the joints such as an end point's coordinate. Claim: w t_m <= g before a
/// period implies that braking in step, v' = v (1 - T/t_s), leads to w' t_m <= g' after it. The ramp covers
/// T (w + w')/2, so the claim reads w' (t_m + T/2) <= g - w T/2, and with w' = w (1 - T/t_s) and g >= w t_m it
/// follows from T - T t_m/t_s - T^2/(2 t_s) <= 0, true as t_s <= t_m. (For T > t_s the ramp ends at rest after
/// w T/2 <= w t_m <= g.) The bounds imposed are
///   |v'_i| <= rate_i,  |v'_i - v_i| <= acceleration_i T,  w' (t_m + T/2) <= g - w T/2,
/// each relaxed to admit braking where the state is already beyond it (the arm was switched on out of range, the end
/// point moved unexpectedly). Braking satisfies them all, so the feasible set is never empty; every point of it
/// satisfies the claim's premise again, so a state that starts at rest within the position limits stays within them for
/// ever, whatever is wanted; between the ends of a period too, since from w > 0 a ramp covers at most w T/2 <= g before
/// it turns. For the image window the same holds up to the curvature of the map and errors of the prediction, for
/// which its margin is there.
LimitedVelocity limit_velocity(const JointLimits& limits, const std::optional<ImageWindow>& window,
                               const MotionState& motion, const std::optional<EndPoints>& ends,
                               const Eigen::Vector4d& wanted, const Eigen::Matrix4d& weight, double period_s,
                               const VelocityRange& range = {});

}  // namespace lapservo::internal
