#include "lapservo/geometry/field_of_view.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lapservo::internal {

namespace {

// The ideal place of the farthest raw pixel with a ray on the way to a corner; short of the fold, where the inverse is
// steep.
Eigen::Vector2d farthest_ideal(const Camera& camera, const Eigen::Vector2d& corner) {
  if (const auto ideal = camera.ideal_from_raw(corner)) return *ideal;
  constexpr int halvings = 40;
  constexpr double short_of_fold = 0.99;
  const Eigen::Vector2d middle(camera.cx_px, camera.cy_px);
  const auto towards = [&](double part) { return camera.ideal_from_raw(middle + part * (corner - middle)); };
  double with_ray = 0, without = 1;
  for (int i = 0; i < halvings; ++i) {
    const double part = 0.5 * (with_ray + without);
    (towards(part) ? with_ray : without) = part;
  }
  return towards(short_of_fold * with_ray).value_or(middle);
}

}  // namespace

double half_field_rad(const Camera& camera) {
  double widest = 0;
  for (const double u : {-0.5, camera.width_px - 0.5})
    for (const double v : {-0.5, camera.height_px - 0.5}) {
      const Eigen::Vector3d ray = camera.ray_from_ideal(farthest_ideal(camera, {u, v}));
      widest = std::max(widest, std::atan(ray.head<2>().norm()));
    }
  return widest;
}

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
