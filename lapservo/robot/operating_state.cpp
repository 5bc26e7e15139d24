#include "lapservo/robot/operating_state.h"

namespace lapservo {

std::string_view to_string(OperatingState state) {
  switch (state) {
    case OperatingState::disabled:
      return "DISABLED";
    case OperatingState::enabled:
      return "ENABLED";
    case OperatingState::paused:
      return "PAUSED";
    case OperatingState::fault:
      return "FAULT";
  }
  return "FAULT";
}

std::optional<OperatingState> operating_state_from_string(std::string_view word) {
  for (const OperatingState state :
       {OperatingState::disabled, OperatingState::enabled, OperatingState::paused, OperatingState::fault})
    if (to_string(state) == word) return state;
  return std::nullopt;
}

}  // namespace lapservo
