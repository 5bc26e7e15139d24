#pragma once

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"

namespace lapservo::internal {

/// Section V-D's gains: K_s = 0.032, K_r = 0.008, K_l = 0.0008, K_d = 0.01. The paper gives no unit of time. Per second
/// they would mean time constants of 31 s to 21 minutes beside a trajectory of 12.6 s, so they are read per control
/// period.
TrackingGains paper_gains(double control_period_s);

/// The gain that makes an error sampled every `period_s` decay exactly as exp(-decay t) when the velocity ramps
/// linearly from the last one to the new one over each period, as JointPath does: e' = e + T (v + v')/2 with v' = -K e
/// has the solution exp(-decay t) for K = (2/T) exp(-decay T) tanh(decay T / 2). Tends to `decay` for small periods.
double exact_gain_ramped(double decay_per_s, double period_s);

/// f - f_d with the angle s (an angle of a directed line: period 2 pi) wrapped to [-pi, pi).
Eigen::Vector4d feature_error(const Eigen::Vector4d& features, const Eigen::Vector4d& desired);

/// f_d' - K (f - f_d): how the features ought to move, rad/s and px/s.
Eigen::Vector4d wanted_feature_rate(const TrackingGains& gains, const Eigen::Vector4d& features,
                                    const Eigen::Vector4d& desired, const Eigen::Vector4d& desired_rate);

/// Inverse of a Jacobian, damped where it is nearly singular.
struct DampedInverse {
  Eigen::Matrix4d inverse = Eigen::Matrix4d::Zero();  ///< d q / d features
  double min_singular_value = 0;                      ///< of the scaled Jacobian
};

/// The Jacobian is scaled to S_f^-1 J S_q and decomposed; a singular value sigma below `threshold` is inverted as
/// sigma / (sigma^2 + damping^2), where damping^2 = threshold^2 - sigma^2 grows from zero at the threshold (Nakamura
/// and Hanafusa 1986; only the weak directions are damped, as in Chiaverini 1997). So the result is exact away from
/// singularities, continuous everywhere and never above 1/threshold in scaled units.
DampedInverse damped_inverse(const Eigen::Matrix4d& jacobian, const Scales& scales, double threshold = 1);

/// The paper's law, eq. (21): v = J^-1 (f_d' - K (f - f_d)), as it stands, with an undamped inverse. Not finite at a
/// singular J.
Eigen::Vector4d paper_velocity(const Eigen::Matrix4d& jacobian, const TrackingGains& gains,
                               const Eigen::Vector4d& features, const Eigen::Vector4d& desired,
                               const Eigen::Vector4d& desired_rate);

}  // namespace lapservo::internal
