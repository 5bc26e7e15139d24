#include "lapservo/robot/arm_port.h"

namespace lapservo {

std::string_view state_word(ArmState state) {
  switch (state) {
    case ArmState::disabled:
      return "DISABLED";
    case ArmState::enabled:
      return "ENABLED";
    case ArmState::paused:
      return "PAUSED";
    case ArmState::fault:
      return "FAULT";
  }
  return "FAULT";
}

std::optional<ArmState> state_from_word(std::string_view word) {
  for (const ArmState state : {ArmState::disabled, ArmState::enabled, ArmState::paused, ArmState::fault})
    if (state_word(state) == word) return state;
  return std::nullopt;
}

}  // namespace lapservo
