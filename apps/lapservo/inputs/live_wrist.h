#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "lapservo/crtk/transport.h"
#include "lapservo/crtk/wrist_history.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/steady_clock.h"

namespace lapservo::app {

/// The joints of wrists as a topic has them.
class LiveWrist {
 public:
  /// `topic`: "ros2:/PSM1/measured_js". Throws InputError for another text and a transport that this build lacks.
  explicit LiveWrist(const std::string& topic);

  /// At the exposure of a frame that arrived at this time of SteadyClock, in the order of Tool::wrist; empty where no
  /// message that came near then has all of them.
  std::vector<double> at_exposure(const Instrument& instrument, double arrival_s) const;

 private:
  SteadyClock clock_;
  std::unique_ptr<internal::Transport> transport_;
  mutable std::mutex mutex_;
  internal::WristHistory history_;
  internal::Transport::Subscription subscription_;  // last: it uses the others
};

}  // namespace lapservo::app
