#pragma once

#include <atomic>
#include <limits>
#include <string>

#include "lapservo/crtk/transport.h"
#include "lapservo/robot/clock.h"

namespace lapservo::internal {

/// Whether an operator presses the first button of a sensor_msgs/Joy, for example a foot pedal, and the topic has said
/// so of late.
class OperatorPresence {
 public:
  /// Both must outlive it.
  OperatorPresence(Transport& transport, const std::string& topic, const Clock& clock)
      : clock_(clock),
        subscription_(transport.subscribe_joys(topic, [this](JoyMessage&& message) { hear(message); })) {}

  /// Throughout since the last call.
  bool was_present() {
    const bool released = released_.exchange(false);
    return !released && clock_.now_s() - pressed_s_ <= max_age_s;
  }

 private:
  void hear(const JoyMessage& message) {
    if (!message.buttons.empty() && message.buttons.front() == 1) {
      pressed_s_ = clock_.now_s();
    } else {
      released_ = true;
      pressed_s_ = never;
    }
  }

  static constexpr double max_age_s = 0.2, never = -std::numeric_limits<double>::infinity();
  const Clock& clock_;
  std::atomic<double> pressed_s_ = never;
  std::atomic<bool> released_ = false;
  Transport::Subscription subscription_;  // last: it uses the others
};

}  // namespace lapservo::internal
