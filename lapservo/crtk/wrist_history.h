#pragma once

#include <deque>
#include <string>
#include <vector>

#include "lapservo/crtk/messages.h"

namespace lapservo::internal {

/// Messages of the last second, for the joints of a wrist as they were when an image was exposed.
class WristHistory {
 public:
  static constexpr double kept_s = 1, near_s = 0.25;

  /// `arrival_s` never falls.
  void add(JointMessage&& message, double arrival_s);
  /// These joints' positions (see wrist_in()) in the message that came nearest to a time, of those that have them all,
  /// finite. Empty where none of these came within near_s of it.
  std::vector<double> at(const std::vector<std::string>& names, double time_s) const;

 private:
  struct Arrived {
    double time_s;
    JointMessage message;
  };
  std::deque<Arrived> all_;
};

}  // namespace lapservo::internal
