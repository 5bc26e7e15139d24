#include "lapservo/control/control_step.h"
#include "lapservo/control/hold_reason.h"
#include "lapservo/control/image_measurement.h"
#include "lapservo/core/words.h"

namespace lapservo {
using namespace internal;

static_assert(word_of(names_up_to<HoldReason::arm_not_enabled>, HoldReason::marker_lost) == "marker_lost");

std::string_view to_string(ControlAction action) {
  return word_of(names_up_to<ControlAction::hold>, action);
}

std::string_view to_string(HoldReason reason) {
  return word_of(names_up_to<HoldReason::arm_not_enabled>, reason);
}

std::optional<HoldReason> hold_reason_from_string(std::string_view word) {
  return read_word(names_up_to<HoldReason::arm_not_enabled>, word);
}

std::string_view to_string(Repetition repetition) {
  return word_of(names_up_to<Repetition::of_a_noisy_camera>, repetition);
}

std::optional<Repetition> repetition_from_string(std::string_view word) {
  return read_word(names_up_to<Repetition::of_a_noisy_camera>, word);
}

}  // namespace lapservo
