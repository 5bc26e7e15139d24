#pragma once

#include <lapservo/robot/robot.h>
#include <optional>

// An arm of one's own: every joint is a mass on a damped spring whose other end the setpoints move.
class SecondOrderArm : public lapservo::Robot {
 public:
  explicit SecondOrderArm(const lapservo::JointVector& start) : position_(start.vector()) {}

  lapservo::JointState state() override {
    return {time_s_, lapservo::JointVector::from_vector(position_), lapservo::OperatingState::enabled};
  }
  void send(const lapservo::JointPath& path) override { path_ = path; }

  // The arm's own controller, a thousand times a second.
  void advance(double step_s) {
    constexpr double omega_rad_s = 60, damping = 0.8;
    time_s_ += step_s;
    const Eigen::Vector4d goal = path_ ? path_->at(time_s_).position : position_;
    velocity_ += step_s * omega_rad_s * (omega_rad_s * (goal - position_) - 2 * damping * velocity_);
    position_ += step_s * velocity_;
  }
  double time_s() const { return time_s_; }

 private:
  double time_s_ = 0;
  Eigen::Vector4d position_, velocity_ = Eigen::Vector4d::Zero();
  std::optional<lapservo::JointPath> path_;
};
