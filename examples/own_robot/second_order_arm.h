#pragma once

#include <algorithm>
#include <condition_variable>
#include <lapservo/robot/robot.h>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

// An arm of one's own: every joint is a mass on a damped spring whose other end the setpoints move. Its controller is a
// thread that samples the path a thousand times a second, in a time that passes while pass() waits; a real arm's thread
// sleeps between two samples instead.
class SecondOrderArm : public lapservo::Robot {
 public:
  explicit SecondOrderArm(const lapservo::JointVector& start) : position_(start.vector()), goal_(position_) {
    thread_ = std::thread([this] { control(); });
  }
  ~SecondOrderArm() override {
    {
      const std::lock_guard lock(mutex_);
      ended_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }

  // The loop's thread. Both return at once.
  lapservo::JointState state() override {
    const std::lock_guard lock(mutex_);
    lapservo::JointState state{time_s_, lapservo::JointVector::from_vector(position_), operating_state_};
    // However short it was: the arm may be ENABLED again by now.
    state.blocked = std::exchange(untold_, lapservo::Blocked::none);
    return state;
  }
  void send(const lapservo::JointPath& path) override {
    const std::lock_guard lock(mutex_);
    if (operating_state_ == lapservo::OperatingState::enabled) path_ = path;
  }

  // The operator.
  void press_emergency_stop() {
    const std::lock_guard lock(mutex_);
    stop(lapservo::OperatingState::disabled);
  }
  void enable() {
    const std::lock_guard lock(mutex_);
    operating_state_ = lapservo::OperatingState::enabled;
  }

  double time_s() const {
    const std::lock_guard lock(mutex_);
    return time_s_;
  }
  // Lets the arm's time pass.
  void pass(double duration_s) {
    std::unique_lock lock(mutex_);
    end_s_ = time_s_ + duration_s;
    changed_.notify_all();
    changed_.wait(lock, [this] { return time_s_ >= end_s_; });
  }

 private:
  void control() {
    std::unique_lock lock(mutex_);
    while (true) {
      changed_.wait(lock, [this] { return ended_ || time_s_ < end_s_; });
      if (ended_) return;
      constexpr double period_s = 0.001;
      advance(std::min(period_s, end_s_ - time_s_));
      if (end_s_ - time_s_ < 1e-12) time_s_ = end_s_;
      changed_.notify_all();
    }
  }
  void advance(double step_s) {
    constexpr double omega_rad_s = 60, damping = 0.8;
    const Eigen::Array4d farthest(0.01, 0.01, 0.001, 0.03);  // rad, m: a setpoint beyond it is a fault, as any arm's is
    time_s_ += step_s;
    const Eigen::Vector4d goal = path_ ? path_->at(time_s_).position : goal_;
    if (((goal - goal_).array().abs() <= farthest).all()) {
      goal_ = goal;
    } else {
      stop(lapservo::OperatingState::fault);  // not a number, too
    }
    velocity_ += step_s * omega_rad_s * (omega_rad_s * (goal_ - position_) - 2 * damping * velocity_);
    position_ += step_s * velocity_;
  }
  // It stays where it is. The path is forgotten: nothing jumps when the arm is enabled again.
  void stop(lapservo::OperatingState state) {
    operating_state_ = state;
    untold_ = lapservo::Blocked::not_enabled;
    goal_ = position_;
    path_.reset();
  }

  mutable std::mutex mutex_;  // of all below
  std::condition_variable changed_;
  bool ended_ = false;
  double time_s_ = 0, end_s_ = 0;
  Eigen::Vector4d position_, goal_, velocity_ = Eigen::Vector4d::Zero();
  std::optional<lapservo::JointPath> path_;
  lapservo::OperatingState operating_state_ = lapservo::OperatingState::enabled;
  lapservo::Blocked untold_ = lapservo::Blocked::none;
  std::thread thread_;  // last: it uses the others
};
