#include "lapservo/core/words.h"
#include "lapservo/robot/blocked.h"
#include "lapservo/robot/operating_state.h"

namespace lapservo {
using namespace internal;
namespace {

constexpr Words<Blocked, 24> blocked_words{{{Blocked::none, "none"},
                                            {Blocked::no_joint_states, "no_joint_states"},
                                            {Blocked::old_joint_states, "old_joint_states"},
                                            {Blocked::non_finite_joints, "non_finite_joints"},
                                            {Blocked::no_setpoint, "no_setpoint"},
                                            {Blocked::no_operating_state, "no_operating_state"},
                                            {Blocked::not_enabled, "not_enabled"},
                                            {Blocked::not_homed, "not_homed"},
                                            {Blocked::busy, "busy"},
                                            {Blocked::far_from_setpoint, "far_from_setpoint"},
                                            {Blocked::foreign_command, "foreign_command"},
                                            {Blocked::second_source, "second_source"},
                                            {Blocked::restarted, "restarted"},
                                            {Blocked::moving, "moving"},
                                            {Blocked::second_camera, "second_camera"},
                                            {Blocked::second_reader, "second_reader"},
                                            {Blocked::no_reader, "no_reader"},
                                            {Blocked::displaced, "displaced"},
                                            {Blocked::held, "held"},
                                            {Blocked::operator_absent, "operator_absent"},
                                            {Blocked::loop_held, "loop_held"},
                                            {Blocked::loop_late, "loop_late"},
                                            {Blocked::arming, "arming"},
                                            {Blocked::ended, "ended"}}};
static_assert(names_all(blocked_words, Blocked::ended));

constexpr Words<OperatingState, 4> state_words{{{OperatingState::disabled, "DISABLED"},
                                                {OperatingState::enabled, "ENABLED"},
                                                {OperatingState::paused, "PAUSED"},
                                                {OperatingState::fault, "FAULT"}}};
static_assert(names_all(state_words, OperatingState::fault));

}  // namespace

std::string_view to_string(Blocked blocked) {
  return word_of(blocked_words, blocked);
}

std::optional<Blocked> blocked_from_string(std::string_view word) {
  return read_word(blocked_words, word);
}

std::string_view to_string(OperatingState state) {
  return word_of(state_words, state);
}

std::optional<OperatingState> operating_state_from_string(std::string_view word) {
  return read_word(state_words, word);
}

}  // namespace lapservo
