#include "lapservo/geometry/invertible.h"

#include <cmath>
#include <numbers>

namespace lapservo::internal {

bool is_invertible(const Camera& camera) {
  const Eigen::Vector2d end(camera.width_px - 1, camera.height_px - 1);
  constexpr int steps = 64;
  for (int i = 0; i < steps; ++i) {
    const double angle_rad = 2 * std::numbers::pi * i / steps;
    const Eigen::Vector2d place =
        0.5 * end + 0.5 * end.minCoeff() * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad));
    if (!camera.ideal_from_raw(place)) return false;
  }
  return true;
}

bool is_invertible_everywhere(const Camera& camera) {
  const double u_end = camera.width_px - 1, v_end = camera.height_px - 1;
  constexpr int steps = 8;
  for (int i = 0; i <= steps; ++i)
    for (const Eigen::Vector2d& border :
         {Eigen::Vector2d(u_end * i / steps, 0), Eigen::Vector2d(u_end * i / steps, v_end),
          Eigen::Vector2d(0, v_end * i / steps), Eigen::Vector2d(u_end, v_end * i / steps)})
      if (!camera.ideal_from_raw(border)) return false;
  return true;
}

}  // namespace lapservo::internal
