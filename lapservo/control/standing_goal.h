#pragma once

#include <algorithm>
#include <optional>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/control/trajectory.h"

namespace lapservo::internal {

/// A goal that stands, within 5 feature scales of where it was, at less than 1 a second: images correct goals of the
/// tip and those before a moving endoscope.
class StandingGoal {
 public:
  explicit StandingGoal(const Scales& scales) : scales_(scales) {}

  /// Between two motions.
  void restart() { goal_.reset(); }
  /// Whether it has stood since the last call.
  bool stands(const DesiredFeatures& desired) {
    constexpr double within = 5, per_s = 1;
    const bool rests = in_scales(desired.rate) < per_s;
    if (rests && goal_ && in_scales(feature_error(desired.features, *goal_)) <= within) return true;
    goal_ = rests ? std::optional(desired.features) : std::nullopt;
    return false;
  }
  double in_scales(const Eigen::Vector4d& features) const { return features.cwiseQuotient(scales_.features).norm(); }

 private:
  Scales scales_;
  std::optional<Eigen::Vector4d> goal_;
};

/// Notices an error that grows while the goal stands: motion that should make it smaller does the opposite.
class ErrorGrowth {
 public:
  explicit ErrorGrowth(const Scales& scales) : goal_(scales) {}

  /// Between two motions.
  void restart() { goal_.restart(); }
  /// Features minus desired ones, while the loop tracks. True when their norm has grown to more than one and a half
  /// times the smallest for this goal, and by 20 feature scales (20 px, 0.1 rad).
  bool add(const DesiredFeatures& desired, const Eigen::Vector4d& error) {
    constexpr double times = 1.5, plain = 20;
    const double now = goal_.in_scales(error);
    smallest_ = goal_.stands(desired) ? std::min(smallest_, now) : now;
    return now > times * smallest_ && now > smallest_ + plain;
  }

 private:
  StandingGoal goal_;
  double smallest_ = 0;  ///< error for it, in feature scales
};

/// Notices a goal that stands and that limits of position keep out of reach: they take part of the motion that the law
/// wants, and the arm has come to rest. Along a limit that is on its way it moves, and at a goal on a limit it wants
/// no motion.
class LimitedGoal {
 public:
  explicit LimitedGoal(const Scales& scales) : goal_(scales) {}

  /// Between two motions.
  void restart() { goal_.restart(); }
  /// Each period while the loop tracks, or would: features minus desired ones; their rates that the law wants, what
  /// limits of position take of them, and those of the arm. True when for 2 s the error was above 2 feature scales (2
  /// px, 10 mrad), and of the rates, in the mean over half a second, more than a tenth was taken and less than a tenth
  /// there.
  bool add(const DesiredFeatures& desired, const Eigen::Vector4d& error, const Eigen::Vector4d& wanted,
           const Eigen::Vector4d& taken, const Eigen::Vector4d& moved, double period_s) {
    constexpr double noise = 2, part = 0.1, mean_s = 0.5, least_s = 2;
    const bool begins = !goal_.stands(desired) || goal_.in_scales(error) <= noise;
    Rates rates;
    rates << wanted, taken, moved;
    mean_ = begins ? rates : Rates(mean_ + std::min(1.0, period_s / mean_s) * (rates - mean_));
    const double least = part * goal_.in_scales(mean_.col(0));
    is_limited_ = !begins && goal_.in_scales(mean_.col(1)) > least;
    const bool is_stopped = is_limited_ && goal_.in_scales(mean_.col(2)) < least;
    stopped_s_ = is_stopped ? stopped_s_ + period_s : 0;
    return stopped_s_ > least_s;
  }
  /// Whether limits take more than a tenth, though the arm may move.
  bool is_limited() const { return is_limited_; }

 private:
  using Rates = Eigen::Matrix<double, 4, 3>;
  StandingGoal goal_;
  Rates mean_ = Rates::Zero();
  double stopped_s_ = 0;
  bool is_limited_ = false;
};

}  // namespace lapservo::internal
