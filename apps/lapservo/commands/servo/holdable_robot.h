#pragma once

#include <utility>
#include <vector>

#include "lapservo/robot/robot.h"

namespace lapservo::app {

/// A simulated arm that a person can hold, as internal::Interlock does a real one: while held it says that it is not
/// enabled and follows no new path, so that the last one brakes to rest. One thread.
class HoldableRobot : public Robot {
 public:
  explicit HoldableRobot(Robot& robot) : robot_(robot) {}

  JointState state() override {
    JointState state = robot_.state();
    if (held_) state.operating_state = OperatingState::paused;
    state.started = std::exchange(started_, false);
    return state;
  }
  std::vector<JointReading> readings() override { return robot_.readings(); }
  void send(const JointPath& path) override {
    if (!held_) robot_.send(path);
  }
  /// False is a start.
  void hold(bool on) { held_ = on, started_ = !on; }
  bool held() const { return held_; }

 private:
  Robot& robot_;
  bool held_ = false, started_ = false;
};

}  // namespace lapservo::app
