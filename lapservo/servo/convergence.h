#pragma once

#include <cmath>
#include <optional>

#include <Eigen/Core>

namespace lapservo {

/// Watches the errors s_rad, r_px, l_px, d_px of a run: converged when all are within 5 mrad and 1 px for a second.
class Convergence {
 public:
  void add(double time_s, const Eigen::Vector4d& error) {
    const bool within = std::abs(error[0]) <= close_rad && error.tail<3>().cwiseAbs().maxCoeff() <= close_px;
    if (!reached_s_ && !within) since_s_.reset(), squares_.setZero(), count_ = 0;
    if (!reached_s_ && within && !since_s_) since_s_ = time_s;
    if (!since_s_) return;
    squares_ += error.cwiseAbs2();
    ++count_;
    if (!reached_s_ && time_s - *since_s_ >= for_s) reached_s_ = *since_s_;
  }

  /// Start of the first such second.
  std::optional<double> reached_s() const { return reached_s_; }
  /// Of all errors from then on; zero before.
  Eigen::Vector4d rms_since() const {
    return reached_s_ ? Eigen::Vector4d((squares_ / static_cast<double>(count_)).cwiseSqrt()) : Eigen::Vector4d::Zero();
  }

 private:
  static constexpr double close_px = 1, close_rad = 5e-3, for_s = 1;
  std::optional<double> since_s_, reached_s_;
  Eigen::Vector4d squares_ = Eigen::Vector4d::Zero();
  long count_ = 0;
};

}  // namespace lapservo
