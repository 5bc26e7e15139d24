#include "lapservo/crtk/stamp_clock.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lapservo::internal {
namespace {

constexpr double jump_s = 0.25;         // a fastest message is not faster than all before by so much
constexpr double drift_s_per_s = 1e-3;  // twice what adjtime slews by
constexpr double disorder_s = 1e-3;     // by which a sender's threads stamp out of order
constexpr double way_s = 0.05;          // by which two messages' ways differ
constexpr double patience_s = 1;        // with messages that are late by the same

}  // namespace

void StampClock::start_anew(const Stamped& message) {
  last_ = message;
  older_.reset();
  late_.reset();
  offset_s_ = message.arrival_s - message.stamp_s;
}

// One message that is older than the last was said again. Two in a row, stamped as far apart as they came, go by a
// clock that was set.
bool StampClock::was_set_back(const Stamped& message) {
  if (message.stamp_s > last_->stamp_s - disorder_s) {
    older_.reset();
    return false;
  }
  const auto before = std::exchange(older_, message);
  if (!before) return false;
  const double advance_s = message.stamp_s - before->stamp_s;
  return advance_s > 0 && std::abs(advance_s - (message.arrival_s - before->arrival_s)) < way_s;
}

// By the same time: one that varies is not a clock's.
bool StampClock::stays_late(const Stamped& message) {
  const double difference_s = message.arrival_s - message.stamp_s;
  if (!late_) late_ = Late{message.arrival_s, difference_s, difference_s};
  late_->least_s = std::min(late_->least_s, difference_s);
  late_->most_s = std::max(late_->most_s, difference_s);
  if (late_->most_s - late_->least_s > way_s) late_ = Late{message.arrival_s, difference_s, difference_s};
  return message.arrival_s - late_->since_s > patience_s;
}

StampClock::Reading StampClock::read(double stamp_s, double arrival_s) {
  if (!std::isfinite(stamp_s) || !(stamp_s > 0)) return {StampVerdict::unusable, 0};
  const Stamped message{stamp_s, arrival_s};
  const double difference_s = arrival_s - stamp_s;
  if (!last_) {
    start_anew(message);
  } else if (difference_s < offset_s_ - jump_s || was_set_back(message)) {
    start_anew(message);
    return {StampVerdict::jumped, 0};
  } else if (stamp_s <= last_->stamp_s) {
    return {StampVerdict::repeated, 0};
  }
  offset_s_ = std::min(difference_s, offset_s_ + drift_s_per_s * (arrival_s - last_->arrival_s));
  last_ = message;
  if (difference_s - offset_s_ > late_s_) {
    if (!stays_late(message)) return {StampVerdict::late, 0};
    start_anew(message);
    return {StampVerdict::jumped, 0};
  }
  late_.reset();
  last_time_s_ = std::max(last_time_s_, stamp_s + offset_s_);
  return {StampVerdict::fresh, last_time_s_};
}

}  // namespace lapservo::internal
