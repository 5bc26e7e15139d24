#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "lapservo/crtk/transport.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/steady_clock.h"

namespace lapservo::app {

/// The joints of wrists as a topic has them now.
class LiveWrist {
 public:
  /// `topic`: "ros2:/PSM1/measured_js". Throws InputError for another text and a transport that this build lacks.
  explicit LiveWrist(const std::string& topic);

  /// In the order of Tool::wrist; empty where no message of the last half second has all of them.
  std::vector<double> newest(const Tool& tool) const;

 private:
  SteadyClock clock_;
  std::unique_ptr<internal::Transport> transport_;
  mutable std::mutex mutex_;
  internal::JointMessage latest_;
  double came_s_ = 0;
  internal::Transport::Subscription subscription_;  // last: it uses the others
};

}  // namespace lapservo::app
