#pragma once

#include <optional>
#include <string_view>

#include <Eigen/Core>

#include "lapservo/control/estimate.h"
#include "lapservo/control/hold_reason.h"
#include "lapservo/robot/joint_path.h"

namespace lapservo {

enum class ControlAction {
  track,  ///< follows the desired features
  probe,  ///< uncalibrated: moves a little to learn the Jacobian
  hold,   ///< brakes to rest and stays there; HoldReason says why
};

/// "track", "probe", "hold".
std::string_view to_string(ControlAction action);

/// A joint whose measured motion the image does not show.
struct Unanswered {
  Eigen::Index joint = 0;  ///< theta, phi, rho, psi
  double slope = 0;        ///< the image's motion per measured motion: 0 at rest, below 0 the other way
};

/// A limit of the arm's place: of a joint, or of an end of the marker in the image window.
struct PositionLimit {
  Eigen::Index of = 0;  ///< theta, phi, rho, psi; u and v of e0; u and v of e3
  bool upper = false;
};

/// The command of the coming period.
struct ControlStep {
  ControlAction action = ControlAction::hold;
  HoldReason reason = HoldReason::none;                ///< none unless holding
  Eigen::Vector4d velocity = Eigen::Vector4d::Zero();  ///< to be reached, by a linear ramp, when the period ends
  bool has_setpoint = false;                           ///< false before the first finite measured joints: send nothing
  MotionState setpoint;                                ///< of the arm when the period ends
  bool limited = false;                                ///< a limit keeps the motion from what the law wants
  std::optional<Estimate> estimate;                 ///< the instrument now; given while holding too, when there is one
  Eigen::Vector4d error = Eigen::Vector4d::Zero();  ///< estimated features minus desired ones; zero without estimate
  double delay_s = 0;                               ///< delay of the image by which the step goes
  bool delay_is_known = false;                      ///< given or estimated: else a first guess
  std::optional<Unanswered> unanswered{};           ///< with HoldReason::image_not_following
  std::optional<PositionLimit> stops_at{};          ///< with goal_beyond_limit, and error_grows along a limit
};

}  // namespace lapservo
