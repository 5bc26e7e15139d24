#pragma once

#include <cmath>
#include <optional>

#include <Eigen/Core>

namespace lapservo::internal {

/// Watches the errors s_rad, r_px, l_px, d_px of a run: converged when all are within 5 mrad and 1 px for a second.
class Convergence {
 public:
  /// `held`: the loop held the arm; from convergence on such errors are counted, and not part of the RMS.
  void add(double time_s, const Eigen::Vector4d& error, bool held = false) {
    const bool within = std::abs(error[0]) <= close_rad && error.tail<3>().cwiseAbs().maxCoeff() <= close_px;
    if (!reached_ && !within) close_ = false, squares_.setZero(), count_ = 0;
    if (!reached_ && within && !close_) close_ = true, since_s_ = time_s;
    if (!close_) return;
    if (reached_ && held) {
      ++held_;
      return;
    }
    squares_ += error.cwiseAbs2();
    ++count_;
    reached_ = reached_ || time_s - since_s_ >= for_s;
  }

  /// Start of the first such second.
  std::optional<double> reached_s() const { return reached_ ? std::optional(since_s_) : std::nullopt; }
  /// Errors in holds from then on.
  long held_since() const { return held_; }
  /// RMS of all other errors from then on; zero before.
  Eigen::Vector4d rms_since() const {
    return reached_ ? Eigen::Vector4d((squares_ / static_cast<double>(count_)).cwiseSqrt()) : Eigen::Vector4d::Zero();
  }

 private:
  static constexpr double close_px = 1, close_rad = 5e-3, for_s = 1;
  bool close_ = false, reached_ = false;
  double since_s_ = 0;  ///< close
  Eigen::Vector4d squares_ = Eigen::Vector4d::Zero();
  long count_ = 0, held_ = 0;
};

}  // namespace lapservo::internal
