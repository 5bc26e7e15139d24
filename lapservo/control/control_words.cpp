#include "lapservo/control/control_step.h"
#include "lapservo/control/hold_reason.h"
#include "lapservo/control/image_measurement.h"
#include "lapservo/core/words.h"

namespace lapservo {
using namespace internal;
namespace {

constexpr Words<ControlAction, 3> action_words{
    {{ControlAction::track, "track"}, {ControlAction::probe, "probe"}, {ControlAction::hold, "hold"}}};
static_assert(names_all(action_words, ControlAction::hold));

constexpr Words<HoldReason, 23> reason_words{{{HoldReason::none, "none"},
                                              {HoldReason::no_image_yet, "no_image_yet"},
                                              {HoldReason::marker_lost, "marker_lost"},
                                              {HoldReason::stale_image, "stale_image"},
                                              {HoldReason::slow_images, "slow_images"},
                                              {HoldReason::frozen_image, "frozen_image"},
                                              {HoldReason::wild_joints, "wild_joints"},
                                              {HoldReason::endoscope_moved, "endoscope_moved"},
                                              {HoldReason::endoscope_measured, "endoscope_measured"},
                                              {HoldReason::wrong_rig, "wrong_rig"},
                                              {HoldReason::outlier, "outlier"},
                                              {HoldReason::no_history, "no_history"},
                                              {HoldReason::psi_contradicted, "psi_contradicted"},
                                              {HoldReason::not_modelled, "not_modelled"},
                                              {HoldReason::singular, "singular"},
                                              {HoldReason::not_following, "not_following"},
                                              {HoldReason::image_not_following, "image_not_following"},
                                              {HoldReason::error_grows, "error_grows"},
                                              {HoldReason::delay_not_found, "delay_not_found"},
                                              {HoldReason::not_learnt, "not_learnt"},
                                              {HoldReason::bad_time, "bad_time"},
                                              {HoldReason::non_finite, "non_finite"},
                                              {HoldReason::arm_not_enabled, "arm_not_enabled"}}};
static_assert(names_all(reason_words, HoldReason::arm_not_enabled));

constexpr Words<Repetition, 3> repetition_words{{{Repetition::none, "none"},
                                                 {Repetition::possible_at_rest, "possible_at_rest"},
                                                 {Repetition::of_a_noisy_camera, "of_a_noisy_camera"}}};
static_assert(names_all(repetition_words, Repetition::of_a_noisy_camera));

}  // namespace

std::string_view to_string(ControlAction action) {
  return word_of(action_words, action);
}

std::string_view to_string(HoldReason reason) {
  return word_of(reason_words, reason);
}

std::string_view to_string(Repetition repetition) {
  return word_of(repetition_words, repetition);
}

std::optional<Repetition> repetition_from_string(std::string_view word) {
  return read_word(repetition_words, word);
}

}  // namespace lapservo
