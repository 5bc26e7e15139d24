#pragma once

#include <Eigen/Core>

#include "lapservo/control/wild_readings.h"

namespace lapservo::internal {

/// WildReadings of an arm's joints. `rate`: their largest commanded speeds.
class WildJoints : public WildReadings<4> {
 public:
  explicit WildJoints(const Eigen::Vector4d& rate) : WildReadings(rate, {0.01, 0.01, 0.001, 0.04}) {}
};

}  // namespace lapservo::internal
