#pragma once

#include <algorithm>
#include <optional>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/control/trajectory.h"

namespace lapservo::internal {

/// Notices an error that grows while the goal stands: motion that should make it smaller does the opposite. A goal
/// stands within 5 feature scales of where it was, at less than 1 a second: images correct goals of the tip and those
/// before a moving endoscope.
class ErrorGrowth {
 public:
  explicit ErrorGrowth(const Scales& scales) : scales_(scales) {}

  /// Between two motions.
  void restart() { goal_.reset(); }
  /// Features minus desired ones, while the loop tracks. True when their norm has grown to more than one and a half
  /// times the smallest for this goal, and by 20 feature scales (20 px, 0.1 rad).
  bool add(const DesiredFeatures& desired, const Eigen::Vector4d& error) {
    constexpr double times = 1.5, plain = 20, stands_within = 5, stands_per_s = 1;
    const auto in_scales = [this](const Eigen::Vector4d& f) { return f.cwiseQuotient(scales_.features).norm(); };
    const double now = in_scales(error);
    const bool rests = in_scales(desired.rate) < stands_per_s;
    if (!rests || !goal_ || in_scales(feature_error(desired.features, *goal_)) > stands_within) {
      goal_ = rests ? std::optional(desired.features) : std::nullopt;
      smallest_ = now;
    }
    smallest_ = std::min(smallest_, now);
    return now > times * smallest_ && now > smallest_ + plain;
  }

 private:
  Scales scales_;
  std::optional<Eigen::Vector4d> goal_;  ///< that stands
  double smallest_ = 0;                  ///< error for it, in feature scales
};

}  // namespace lapservo::internal
