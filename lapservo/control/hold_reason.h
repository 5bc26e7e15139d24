#pragma once

#include <optional>
#include <string_view>

namespace lapservo {

/// Why the controller holds.
enum class HoldReason {
  none,
  no_image_yet,
  marker_lost,          ///< the latest image does not show the marker
  stale_image,          ///< no usable image for too long, or one that was too old when it came
  slow_images,          ///< images usually come less often than every ControllerConfig::stale_after_s
  frozen_image,         ///< the same image again, whatever its stamp: noise repeats, or joints move and features don't
  wild_joints,          ///< measured joints that no arm can have come to since the last ones
  endoscope_moved,      ///< the shaft misses the RCM all of a sudden: the operator's motion is to show where it is now
  endoscope_measured,   ///< it did; goes on after the operator's start
  wrong_rig,            ///< joints and images have disagreed from the start: ServoDecision::remedy
  outlier,              ///< the latest image contradicts the measured joints and the images before
  no_history,           ///< the image is older than the measured joints
  psi_contradicted,     ///< the image shows the instrument turned farther from measured psi than max_offset allows
  not_modelled,         ///< the model has no features where the instrument is, or none that match
  singular,             ///< the Jacobian can't be inverted here
  not_following,        ///< the arm is far from its setpoint: reset() when it is in order again
  image_not_following,  ///< the image does not show a joint's motion: ControlStep::unanswered; until a start
  error_grows,          ///< the goal stands and the error grows, although the arm moves: until a start
  delay_not_found,      ///< after ample motion images and joints agree at no delay: until a start
  tip_open,             ///< the tool, bent as it is, leaves the tip open by more than a goal of the tip allows
  tip_unreachable,      ///< no configuration in view holds the tip at its goal, as wrist and camera are
  goal_beyond_limit,    ///< the goal stands, and a limit keeps the arm from it: ControlStep::stops_at
  not_learnt,           ///< uncalibrated: the probing motion said too little; it is repeated
  bad_time,             ///< time did not advance
  non_finite,           ///< joints, image, desired features or the result hold a NaN or an infinity
  arm_not_enabled,      ///< the arm's operating state is not ENABLED
};
/// The enumerator's name; nullopt for anything else.
std::string_view to_string(HoldReason reason);
std::optional<HoldReason> hold_reason_from_string(std::string_view word);

}  // namespace lapservo
