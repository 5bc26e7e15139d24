#include "lapservo/control/control_step.h"

namespace lapservo {

std::string_view to_string(ControlAction action) {
  switch (action) {
    case ControlAction::track:
      return "track";
    case ControlAction::probe:
      return "probe";
    case ControlAction::hold:
      return "hold";
  }
  return "";
}

}  // namespace lapservo
