#include "lapservo/control/image_measurement.h"

#include "lapservo/core/words.h"

namespace lapservo {
using namespace internal;
namespace {

constexpr Words<Repetition, 3> repetition_words{{{Repetition::none, "none"},
                                                 {Repetition::possible_at_rest, "possible_at_rest"},
                                                 {Repetition::of_a_noisy_camera, "of_a_noisy_camera"}}};
static_assert(names_all(repetition_words, Repetition::of_a_noisy_camera));

}  // namespace

std::string_view to_string(Repetition repetition) {
  return word_of(repetition_words, repetition);
}

std::optional<Repetition> repetition_from_string(std::string_view word) {
  return read_word(repetition_words, word);
}

}  // namespace lapservo
