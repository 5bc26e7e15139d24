#pragma once

#include <optional>
#include <string_view>

#include "lapservo/control/feature_model.h"
#include "lapservo/control/jacobian_estimator.h"
#include "lapservo/control/motion_limits.h"
#include "lapservo/control/offset_observer.h"
#include "lapservo/control/probing.h"
#include "lapservo/control/tracking_law.h"

namespace lapservo {

enum class ControlMode {
  fused,         ///< the default: readings and late images fused by OffsetObserver
  paper,         ///< eq. (21) as it stands, on the latest image alone
  uncalibrated,  ///< no model: the Jacobian is probed, then learnt on the way
};
std::string_view mode_word(ControlMode mode);
/// "default" and "fused", "paper", "uncalibrated"; nullopt for anything else.
std::optional<ControlMode> mode_from_word(std::string_view word);

struct ControllerConfig {
  ControlMode mode = ControlMode::fused;
  double period_s = 1.0 / 60;  ///< between calls of step()
  /// Decay rates per second. Modes `fused` and `uncalibrated` turn them into the exact gains of the sampled loop;
  /// `paper` uses them as they stand (set them to paper_gains(period_s)).
  TrackingGains gains;
  JointLimits limits;
  std::optional<ImageWindow> window;  ///< the camera's image less a margin, for the marker's ends
  Scales scales;
  ObserverConfig observer;  ///< its delay_s holds for all modes
  JacobianEstimatorConfig jacobian;
  ProbingConfig probing;
  double damping_threshold = 1;        ///< of damped_inverse
  double least_singular_value = 0.01;  ///< of the scaled Jacobian: below it the controller holds
  double stale_after_s = 0.1;          ///< hold when no usable image arrived for so long
  double largest_image_age_s = 0.6;    ///< at arrival, by its stamp
  /// Hold when the arm is farther from its setpoint than this: theta_rad, phi_rad, rho_m, psi_rad.
  Eigen::Vector4d largest_following_error{0.1, 0.1, 0.01, 0.4};
};

/// The paper's method: its law, its gains per control period, the rest as by default.
ControllerConfig paper_controller(double period_s);

/// Returns the configuration if all its numbers make sense; else throws InputError naming the first field that doesn't.
ControllerConfig checked(const ControllerConfig& config);

}  // namespace lapservo
