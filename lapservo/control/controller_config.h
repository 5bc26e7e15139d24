#pragma once

#include <optional>
#include <string_view>

#include <Eigen/Core>

namespace lapservo {

enum class ControlMode {
  fused,         ///< the default: measured joints and late images fused by OffsetObserver
  paper,         ///< eq. (21) as it stands, on the latest image alone
  uncalibrated,  ///< no model: the Jacobian is probed, then learnt on the way
};
std::string_view to_string(ControlMode mode);
/// "default" and "fused", "paper", "uncalibrated"; nullopt for anything else.
std::optional<ControlMode> control_mode_from_string(std::string_view word);

/// Typical sizes, by which radians, metres and pixels are compared.
struct Scales {
  Eigen::Vector4d features{0.005, 1, 1, 1};     ///< s_rad, r_px, l_px, d_px: what "close" means in the image
  Eigen::Vector4d joints{0.1, 0.1, 0.01, 0.3};  ///< theta_rad, phi_rad, rho_m, psi_rad: a motion that is plain to see
};

/// K of eq. (21), per second, for s, r, l, d.
struct TrackingGains {
  Eigen::Vector4d per_s{5, 5, 5, 5};
};

/// Bounds of the joints as the arm reads them: theta, phi, rho, psi; rad and m. Ranges, rates and accelerations that
/// look like degrees or millimetres are refused.
struct JointLimits {
  Eigen::Vector4d lower{-1, 0.6, 0.03, -4};
  Eigen::Vector4d upper{1, 2.5, 0.2, 4};
  Eigen::Vector4d rate{0.4, 0.4, 0.04, 1.5};     ///< rad/s, m/s
  Eigen::Vector4d acceleration{2, 2, 0.2, 7.5};  ///< rad/s^2, m/s^2
};

/// Those within which both hold: of each joint the nearer position, and the lower rate and acceleration.
JointLimits both_limits(const JointLimits& a, const JointLimits& b);

/// Where the marker's end points have to stay, in the pixels of FeatureState::ends_px.
struct ImageWindow {
  double u_min_px = 0, u_max_px = 0, v_min_px = 0, v_max_px = 0;
};

struct DelayEstimatorConfig {
  double forgetting_s = 20;    ///< time constant by which old frames lose weight
  double offset_time_s = 2;    ///< time constant of the mean that is removed: slower differences don't count
  double min_time_s = 1;       ///< no estimate before this much has been seen
  double max_sigma_s = 0.005;  ///< nor one less certain than this: then there was too little motion
  /// Disagreement between measured joints and the true joints that is not noise: theta_rad, phi_rad, rho_m, psi_rad.
  /// Backlash looks like additional delay, so insertion and roll count little.
  Eigen::Vector4d measured_sigma{2e-4, 2e-4, 1e-3, 2e-2};
};

struct BacklashEstimatorConfig {
  /// The widest gap looked for: theta_rad, phi_rad, rho_m, psi_rad; 0 where there is none.
  Eigen::Vector4d largest{0, 0, 5e-4, 0.1};
  double forgetting_s = 60;  ///< time constant by which old frames lose weight
  double offset_time_s = 2;  ///< time constant of the mean that is removed: slower differences don't count
  double model_error = 0.3;  ///< what a wrong model makes of motion, a fraction of it: one sigma
  double delay_error_s = 0.01;
  double max_sigma = 0.03;  ///< fraction of the largest width: estimates less certain don't count
};

struct ObserverConfig {
  std::optional<double> delay_s;  ///< known delay; absent: estimated from the data
  double initial_delay_s = 0.1;   ///< until there is an estimate
  double bandwidth_rad_s = 12;    ///< how fast the offset follows the image
  /// Random walk of the offset between measured joints and truth, per square root of a second: theta, phi, rho, psi.
  Eigen::Vector4d offset_walk{0.002, 0.002, 0.0003, 0.008};
  /// The offset changes with motion too (a wrong camera model, backlash not learnt): by about this fraction of the
  /// distance moved.
  double offset_per_motion = 0.3;
  /// How far the offset may move the model's configuration from the measured joints; what a wrong model needs beyond
  /// that is put into the features instead.
  Eigen::Vector4d max_offset{0.35, 0.35, 0.03, 0.8};
  double gate_chi2 = 28.5;  ///< innovations beyond it are outliers: 1 in 100000 of 4 degrees of freedom
  int reacquire_after = 5;  ///< so many outliers in a row that agree with each other are the truth
  DelayEstimatorConfig delay_estimator;
  BacklashEstimatorConfig backlash;
};

struct JacobianEstimatorConfig {
  double noise = 0.3;       ///< of an image, in feature scales
  double walk = 0.3;        ///< of the features at rest, in feature scales per square root of a second
  double bend = 12;         ///< how much J changes along a joint scale of motion, in scales: forgetting by distance
  double slack = 3;         ///< features' change that motion doesn't explain (backlash), per joint scale moved
  double gate_chi2 = 60;    ///< of four features; curvature adds to noise, so wider than noise alone would need
  int reacquire_after = 5;  ///< so many outliers in a row that agree are the truth
};

struct ProbingConfig {
  /// How far each joint goes, one after the other, and comes back: theta_rad, phi_rad, rho_m, psi_rad.
  Eigen::Vector4d distance{0.03, 0.03, 0.004, 0.16};
  double joint_time_s = 0.7;  ///< there and back
};

struct ControllerConfig {
  ControlMode mode = ControlMode::fused;
  double period_s = 1.0 / 60;  ///< between calls of step()
  /// Decay rates per second. Modes `fused` and `uncalibrated` turn them into the exact gains of the sampled loop;
  /// `paper` uses them as they stand (set them to paper_gains(period_s)), each below 1 / (e x the images' delay), which
  /// is observer.delay_s or, without one, observer.initial_delay_s.
  TrackingGains gains;
  JointLimits limits;
  std::optional<ImageWindow> window;  ///< the camera's image less a margin, for the marker's ends
  Scales scales;
  ObserverConfig observer;  ///< its delay_s holds for all modes
  JacobianEstimatorConfig jacobian;
  ProbingConfig probing;
  double damping_threshold = 1;      ///< of damped_inverse
  double min_singular_value = 0.01;  ///< of the scaled Jacobian: below it the controller holds
  double stale_after_s = 0.1;        ///< hold when no usable image arrived for so long
  double max_image_age_s = 0.6;      ///< at arrival, by its stamp
  /// How wrong an element of the model's Jacobian may be, as a part of it: by so much the image may answer one joint's
  /// motion with another's before the loop holds (image_not_following).
  double model_error = 0.2;
  /// Hold when the arm is farther from its setpoint than this: theta_rad, phi_rad, rho_m, psi_rad.
  Eigen::Vector4d max_following_error{0.1, 0.1, 0.01, 0.4};
};

/// The paper's method: its law, its gains per control period, the rest as by default.
ControllerConfig paper_controller(double period_s);

/// Returns the configuration if all its numbers make sense; else throws InputError naming the first field that doesn't.
ControllerConfig checked(const ControllerConfig& config);

}  // namespace lapservo
