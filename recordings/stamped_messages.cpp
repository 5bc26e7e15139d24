#include "recordings/stamped_messages.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <variant>
#include <vector>

#include <fmt/format.h>

#include "lapservo/core/statistics.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t looked_ahead = 5;  // messages, and as many behind
constexpr auto not_later = "its stamp is not later than the one before";

// nullopt of what is no message of its type.
std::optional<double> stamp_of(const BagMessage& message) {
  return std::visit(
      [](const auto& one) -> std::optional<double> {
        if constexpr (requires { one.stamp_s; }) return one.stamp_s;
        return std::nullopt;
      },
      message);
}

}  // namespace

StampedMessages::StampedMessages(std::unique_ptr<BagMessages> messages, std::function<bool(const BagMessage&)> wanted)
    : messages_(std::move(messages)), wanted_(std::move(wanted)) {}

void StampedMessages::leave_out(const std::string& why) {
  if (left_out_++ == 0) why_ = why;
}

void StampedMessages::leave_out_repeated() {
  ++repeated_;
  leave_out(not_later);
}

void StampedMessages::look_ahead() {
  while (!ended_ && ahead_.size() <= looked_ahead) {
    auto message = messages_->next();
    ended_ = !message;
    if (ended_ || (wanted_ && !wanted_(*message))) continue;
    const auto stamp_s = stamp_of(*message);
    if (!stamp_s) {
      leave_out("no message of its type; message by message compressed bags want `ros2 bag convert`");
    } else if (!(*stamp_s > 0)) {
      leave_out("no stamp");
    } else if (*stamp_s == last_read_s_) {
      leave_out_repeated();
    } else {
      last_read_s_ = *stamp_s;
      ahead_.push_back({{*stamp_s, messages_->recorded_s()}, std::move(*message)});
    }
  }
}

// The usual lead of the stamps over the recorder's clock, and how far one may be from it: as far as the messages
// themselves are apart, for recorders that have one time for many.
StampedMessages::Around StampedMessages::around(const Seen& seen) const {
  std::vector<double> leads_s{seen.lead_s()}, stamps_s{seen.stamp_s}, gaps_s{0};
  const auto add = [&](const Seen& one) { leads_s.push_back(one.lead_s()), stamps_s.push_back(one.stamp_s); };
  for (const Seen& one : behind_) add(one);
  for (const Ahead& one : ahead_) add(one.seen);
  std::sort(stamps_s.begin(), stamps_s.end());
  for (std::size_t i = 1; i < stamps_s.size(); ++i) gaps_s.push_back(stamps_s[i] - stamps_s[i - 1]);
  constexpr double least_s = 0.2;
  return {median(leads_s), std::max(least_s, (looked_ahead + 1) * quantile_of(gaps_s, 0.5))};
}

// Whether this stamp and all of those ahead are before the last one: a stamp that is repeated is no clock that was set.
bool StampedMessages::goes_back(const Seen& seen) const {
  return seen.stamp_s < last_stamp_s_ && ahead_.size() >= looked_ahead &&
         std::all_of(ahead_.begin(), ahead_.end(), [&](const Ahead& one) { return one.seen.stamp_s < last_stamp_s_; });
}

// The usual time from one of the stamps ahead to the next.
double StampedMessages::usual_gap_s(const Seen& seen) const {
  std::vector<double> gaps_s;
  double before_s = seen.stamp_s;
  for (const Ahead& one : ahead_) gaps_s.push_back(one.seen.stamp_s - std::exchange(before_s, one.seen.stamp_s));
  return quantile_of(gaps_s, 0.5);
}

std::optional<StampedMessage> StampedMessages::next() {
  constexpr double least_step_s = 10;  // recorders and networks are late by less
  while (look_ahead(), !ahead_.empty()) {
    auto [seen, message] = std::move(ahead_.front());
    ahead_.pop_front();
    const auto [lead_s, tolerance_s] = around(seen);
    behind_.push_back(seen);
    if (behind_.size() > looked_ahead) behind_.pop_front();
    if (std::abs(seen.lead_s() - lead_s) > tolerance_s) {
      leave_out(fmt::format("its stamp is {:.1f} s from those around it", seen.lead_s() - lead_s));
      continue;
    }
    const double step_s = last_lead_s_ ? lead_s - *last_lead_s_ : 0;
    if (step_s > least_step_s || goes_back(seen)) {
      constexpr double least_s = 1e-6;
      shift_s_ -= step_s;
      // The recorder's clock was set back with it, or has one time for many.
      if (seen.stamp_s + shift_s_ <= *last_s_) {
        shift_s_ = *last_s_ + std::max(usual_gap_s(seen), least_s) - seen.stamp_s;
        ++steps_by_gap_;
      }
      ++steps_;
    }
    const double time_s = seen.stamp_s + shift_s_;
    if (last_s_ && !(time_s > *last_s_)) {
      seen.stamp_s == last_stamp_s_ ? leave_out_repeated() : leave_out(not_later);
      continue;
    }
    last_s_ = time_s, last_lead_s_ = lead_s, last_stamp_s_ = seen.stamp_s;
    return StampedMessage{time_s, seen.recorded_s, std::move(message)};
  }
  return std::nullopt;
}

}  // namespace lapservo::internal
