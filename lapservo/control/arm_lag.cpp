#include "lapservo/control/arm_lag.h"

#include <algorithm>
#include <cmath>

namespace lapservo::internal {

void ArmLag::add(const MotionState& setpoint, const Eigen::Vector4d& q_joint, double interval_s) {
  constexpr double forgetting_s = 10;
  const double kept = std::exp(-interval_s / forgetting_s);
  const Eigen::Vector4d ahead = (setpoint.position - q_joint).cwiseQuotient(scales_.joints);
  const Eigen::Vector4d velocity = setpoint.velocity.cwiseQuotient(scales_.joints);
  cross_ = kept * cross_ + interval_s * ahead.dot(velocity);
  square_ = kept * square_ + interval_s * velocity.squaredNorm();
}

double ArmLag::seconds() const {
  constexpr double little = 1e-2;  // pulls the lag to 0 until the arm has moved about a tenth of the joint scale
  constexpr double max_s = 0.1;
  return std::clamp(cross_ / (square_ + little), 0.0, max_s);
}

}  // namespace lapservo::internal
