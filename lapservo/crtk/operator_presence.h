#pragma once

#include <string>

#include "lapservo/crtk/transport.h"
#include "lapservo/robot/clock.h"
#include "lapservo/robot/held_button.h"

namespace lapservo::internal {

/// Whether an operator presses a button of a topic, for example a foot pedal: see Transport::subscribe().
class OperatorPresence {
 public:
  /// Both must outlive it.
  OperatorPresence(Transport& transport, const std::string& topic, const Clock& clock)
      : clock_(clock), subscription_(transport.subscribe<BoolMessage>(topic, [this](BoolMessage&& pressed) {
          pressed.value ? button_.press(clock_.now_s()) : button_.release();
        })) {}

  /// Throughout since the last call.
  bool was_present() { return button_.was_held(clock_.now_s()); }

 private:
  const Clock& clock_;
  HeldButton button_;
  Transport::Subscription subscription_;  // last: it uses the others
};

}  // namespace lapservo::internal
