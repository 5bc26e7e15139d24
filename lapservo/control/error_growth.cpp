#include "lapservo/control/error_growth.h"

#include <algorithm>

#include "lapservo/control/tracking_law.h"

namespace lapservo::internal {

bool ErrorGrowth::add(const DesiredFeatures& desired, const Eigen::Vector4d& error) {
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

}  // namespace lapservo::internal
