#include "lapservo/control/error_growth.h"

#include <algorithm>

namespace lapservo::internal {

bool ErrorGrowth::add(const DesiredFeatures& desired, const Eigen::Vector4d& error) {
  constexpr double times = 1.5, plain = 20;
  const double now = error.cwiseQuotient(scales_.features).norm();
  if (!desired.rate.isZero() || goal_ != desired.features) {
    goal_.reset();
    if (desired.rate.isZero()) goal_ = desired.features;
    smallest_ = now;
  }
  smallest_ = std::min(smallest_, now);
  return now > times * smallest_ && now > smallest_ + plain;
}

}  // namespace lapservo::internal
