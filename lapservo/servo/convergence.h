#pragma once

#include <cmath>
#include <optional>

#include <Eigen/Core>

namespace lapservo::internal {

/// Watches the errors s_rad, r_px, l_px, d_px of a run: converged while all have been within 5 mrad and 1 px for a
/// second and longer, holds of the loop aside. Errors that leave the bounds end it, until it converges again.
class Convergence {
 public:
  /// `held`: the loop held the arm; from convergence on such errors end nothing, and are no part of the RMS.
  /// `tip_error_px`: see ControlTick.
  void add(double time_s, const Eigen::Vector4d& error, bool held = false,
           const std::optional<Eigen::Vector2d>& tip_error_px = {}) {
    const bool within = std::abs(error[0]) <= close_rad && error.tail<3>().cwiseAbs().maxCoeff() <= close_px;
    if (!within && !(reached_ && held)) since_.reset(), reached_ = false;
    if (within && !since_) since_ = Since{time_s};
    if (!since_) return;
    if (reached_ && held) {
      ++since_->held;
    } else {
      since_->squares += error.cwiseAbs2();
      ++since_->count;
      reached_ = reached_ || time_s - since_->time_s >= for_s;
    }
    if (!reached_) return;
    if (!first_s_) first_s_ = since_->time_s;
    if (tip_error_px) since_->tip_squares_px2 += tip_error_px->squaredNorm(), ++since_->tips;
  }

  /// Start of the first such second, whatever came after.
  std::optional<double> first_s() const { return first_s_; }
  /// Since when it is converged.
  std::optional<double> reached_s() const { return reached_ ? std::optional(since_->time_s) : std::nullopt; }
  /// Errors in holds since then.
  long held_since() const { return reached_ ? since_->held : 0; }
  /// RMS of all other errors since then; zero before.
  Eigen::Vector4d rms_since() const {
    return reached_ ? Eigen::Vector4d((since_->squares / static_cast<double>(since_->count)).cwiseSqrt())
                    : Eigen::Vector4d::Zero();
  }
  /// RMS of the seen tip from its goal since it is converged; nullopt where none was seen.
  std::optional<double> tip_rms_px() const {
    if (!reached_ || since_->tips == 0) return std::nullopt;
    return std::sqrt(since_->tip_squares_px2 / static_cast<double>(since_->tips));
  }

 private:
  static constexpr double close_px = 1, close_rad = 5e-3, for_s = 1;
  /// All that is summed since the errors are within.
  struct Since {
    double time_s = 0;
    Eigen::Vector4d squares = Eigen::Vector4d::Zero();
    long count = 0, held = 0;
    double tip_squares_px2 = 0;
    long tips = 0;
  };
  std::optional<Since> since_;
  bool reached_ = false;
  std::optional<double> first_s_;
};

}  // namespace lapservo::internal
