#include "lapservo/crtk/stamp_clock.h"

#include <algorithm>
#include <cmath>

#include "lapservo/core/words.h"

namespace lapservo::internal {
namespace {

constexpr double jump_s = 0.25;         // no network reorders messages by so much
constexpr double drift_s_per_s = 1e-3;  // twice what adjtime slews by

constexpr Words<StampVerdict, 5> verdict_words{{{StampVerdict::fresh, "fresh"},
                                                {StampVerdict::repeated, "repeated"},
                                                {StampVerdict::late, "late"},
                                                {StampVerdict::jumped, "jumped"},
                                                {StampVerdict::unusable, "unusable"}}};
static_assert(names_all(verdict_words, StampVerdict::unusable));

}  // namespace

std::string_view to_string(StampVerdict verdict) {
  return word_of(verdict_words, verdict);
}

void StampClock::start_anew(double stamp_s, double arrival_s) {
  last_stamp_s_ = stamp_s;
  last_arrival_s_ = arrival_s;
  offset_s_ = arrival_s - stamp_s;
}

StampClock::Reading StampClock::read(double stamp_s, double arrival_s) {
  if (!std::isfinite(stamp_s) || !(stamp_s > 0)) return {StampVerdict::unusable, 0};
  const bool first = !last_stamp_s_;
  if (first) start_anew(stamp_s, arrival_s);
  const double advance_s = stamp_s - *last_stamp_s_;
  const double difference_s = arrival_s - stamp_s;
  if (advance_s < -jump_s || difference_s < offset_s_ - jump_s) {
    start_anew(stamp_s, arrival_s);
    return {StampVerdict::jumped, 0};
  }
  if (!first && advance_s <= 0) return {StampVerdict::repeated, 0};
  offset_s_ = std::min(difference_s, offset_s_ + drift_s_per_s * (arrival_s - last_arrival_s_));
  last_stamp_s_ = stamp_s;
  last_arrival_s_ = arrival_s;
  if (difference_s - offset_s_ > late_s_) return {StampVerdict::late, 0};
  last_time_s_ = std::max(last_time_s_, stamp_s + offset_s_);
  return {StampVerdict::fresh, last_time_s_};
}

}  // namespace lapservo::internal
