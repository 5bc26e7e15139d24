#pragma once

#include <cmath>
#include <vector>

#include <Eigen/Cholesky>

#include "lapservo/rcm/line_observation.h"
#include "lapservo/testing/seeded_random.h"

namespace lapservo::testing {
using namespace internal;

/// Lines through a point, seen over a stretch of 200 to 500 px that begins 300 to 900 px from it, within a fan.
inline std::vector<LineObservation> fan_of_lines(const Eigen::Vector2d& through_px, std::size_t count, double fan_rad,
                                                 Random& random) {
  std::vector<LineObservation> lines;
  for (std::size_t i = 0; i < count; ++i) {
    const double angle = 0.3 + random.uniform(-fan_rad / 2, fan_rad / 2), near_px = random.uniform(300, 900);
    const Eigen::Vector2d along(std::cos(angle), std::sin(angle));
    lines.push_back(
        line_between(through_px + near_px * along, through_px + (near_px + random.uniform(200, 500)) * along, 0.3));
  }
  return lines;
}

/// The line with a normal error of its own covariance; factor = 0: none.
inline LineObservation with_error(LineObservation line, double factor, Random& random) {
  const Eigen::Matrix4d root = line.covariance_px2.llt().matrixL();
  const Eigen::Vector4d error =
      factor * (root * Eigen::Vector4d(random.normal(), random.normal(), random.normal(), random.normal()));
  line.from_px += error.head<2>(), line.to_px += error.tail<2>();
  return line;
}

}  // namespace lapservo::testing
