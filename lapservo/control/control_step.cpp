#include "lapservo/control/control_step.h"

#include "lapservo/core/words.h"

namespace lapservo {
using namespace internal;
namespace {

constexpr Words<ControlAction, 3> action_words{
    {{ControlAction::track, "track"}, {ControlAction::probe, "probe"}, {ControlAction::hold, "hold"}}};
static_assert(names_all(action_words, ControlAction::hold));

}  // namespace

std::string_view to_string(ControlAction action) {
  return word_of(action_words, action);
}

}  // namespace lapservo
