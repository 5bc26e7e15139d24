#pragma once

#include <cmath>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "lapservo/crtk/joint_map.h"
#include "lapservo/crtk/messages.h"

namespace lapservo::internal {

/// Messages of the last second, for the joints of a wrist as they were when an image was exposed.
class WristHistory {
 public:
  static constexpr double kept_s = 1, near_s = 0.25;
  /// Delays behind the joints that images by their clock may have; the earliest is the noise of one that is 0.
  static constexpr double earliest_delay_s = -0.02, longest_delay_s = kept_s - near_s;

  /// `arrival_s` never falls.
  void add(JointMessage&& message, double arrival_s) {
    while (!all_.empty() && all_.front().time_s < arrival_s - kept_s) all_.pop_front();
    if (message.positions.size() == message.names.size()) all_.push_back({arrival_s, std::move(message)});
  }
  /// These joints' positions (see wrist_in()) in the message that came nearest to a time, of those that have them all,
  /// finite. Empty where none of these came within near_s of it.
  std::vector<double> at(const std::vector<std::string>& names, double time_s) const {
    std::vector<double> nearest;
    double apart_s = near_s;
    for (const Arrived& arrived : all_) {
      if (std::abs(arrived.time_s - time_s) > apart_s) continue;
      std::vector<double> found = wrist_in(arrived.message, names);
      if (found.empty() || !all_finite(found)) continue;
      nearest = std::move(found), apart_s = std::abs(arrived.time_s - time_s);
    }
    return nearest;
  }

 private:
  struct Arrived {
    double time_s;
    JointMessage message;
  };
  std::deque<Arrived> all_;
};

}  // namespace lapservo::internal
