#pragma once

#include <optional>
#include <string_view>

namespace lapservo {

/// Why an arm is not moved.
enum class Blocked {
  none,
  no_joint_states,    ///< none has come yet
  old_joint_states,   ///< none with a new stamp for too long
  non_finite_joints,  ///< the latest holds a NaN or an infinity
  no_setpoint,        ///< where the arm wants to be is not known, or not any more
  no_operating_state,
  not_enabled,
  not_homed,
  busy,
  far_from_setpoint,  ///< the arm is not where its own setpoint is
  foreign_command,    ///< another program moves the arm
  second_source,      ///< two programs publish the states of this arm
  restarted,          ///< another program than before publishes its states: nothing that was known holds
  moving,             ///< the arm moves without being sent anywhere
  second_camera,      ///< another program publishes the images that the loop goes by, too or instead
  second_reader,      ///< more programs than the arm's read its setpoints
  no_reader,          ///< nobody reads its setpoints
  displaced,          ///< the arm is not where it was sent: something moved or blocked it
  held,               ///< a person said stop
  operator_absent,    ///< the operator does not press what has to be pressed
  loop_held,          ///< the loop itself held the arm for too long, or for a reason that needs a person
  loop_late,          ///< the loop stood still: nobody watched the arm meanwhile
  arming,             ///< a start was said and waits until the arm has been ready for long enough
  ended,              ///< the run has ended
};
/// The enumerator's name.
std::string_view to_string(Blocked blocked);
std::optional<Blocked> blocked_from_string(std::string_view word);
/// The arm says nothing new, which may be the network: a short gap passes without a start.
constexpr bool is_silence(Blocked blocked) {
  return blocked == Blocked::old_joint_states || blocked == Blocked::no_setpoint;
}

}  // namespace lapservo
