#include "lapservo/core/words.h"
#include "lapservo/robot/blocked.h"
#include "lapservo/robot/operating_state.h"

namespace lapservo {
using namespace internal;
namespace {

constexpr Words<OperatingState, 4> state_words{{{OperatingState::disabled, "DISABLED"},
                                                {OperatingState::enabled, "ENABLED"},
                                                {OperatingState::paused, "PAUSED"},
                                                {OperatingState::fault, "FAULT"}}};
static_assert(names_all(state_words, OperatingState::fault));

}  // namespace

std::string_view to_string(Blocked blocked) {
  return word_of(names_up_to<Blocked::ended>, blocked);
}

std::optional<Blocked> blocked_from_string(std::string_view word) {
  return read_word(names_up_to<Blocked::ended>, word);
}

std::string_view to_string(OperatingState state) {
  return word_of(state_words, state);
}

std::optional<OperatingState> operating_state_from_string(std::string_view word) {
  return read_word(state_words, word);
}

}  // namespace lapservo
