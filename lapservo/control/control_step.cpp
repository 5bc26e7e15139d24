#include "lapservo/control/control_step.h"

#include "lapservo/core/words.h"

namespace lapservo {
using namespace internal;
namespace {

constexpr Words<ControlAction, 3> words{
    {{ControlAction::track, "track"}, {ControlAction::probe, "probe"}, {ControlAction::hold, "hold"}}};
static_assert(names_all(words, ControlAction::hold));

}  // namespace

std::string_view to_string(ControlAction action) {
  return word_of(words, action);
}

}  // namespace lapservo
