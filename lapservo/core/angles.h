#pragma once

#include <cmath>
#include <numbers>

namespace lapservo::internal {

inline constexpr double pi = std::numbers::pi;
inline constexpr double two_pi = 2 * std::numbers::pi;
inline constexpr double whole_turn_deg = 360;

constexpr double rad_from_deg(double angle_deg) {
  return angle_deg * (pi / 180);
}
constexpr double deg_from_rad(double angle_rad) {
  return angle_rad * (180 / pi);
}

/// The same angle in [-pi, pi).
inline double wrap_pi(double angle_rad) {
  const double wrapped = std::remainder(angle_rad, two_pi);
  return wrapped >= pi ? wrapped - two_pi : wrapped;
}

/// The same angle in [0, 2 pi).
inline double wrap_two_pi(double angle_rad) {
  if (angle_rad >= 0 && angle_rad < two_pi) return angle_rad;
  double wrapped = angle_rad < 0 && angle_rad > -two_pi ? angle_rad : std::fmod(angle_rad, two_pi);
  if (wrapped < 0) wrapped += two_pi;
  return wrapped >= two_pi ? 0.0 : wrapped;
}

/// Size of the angle between two hues.
inline double hue_gap_deg(double a_deg, double b_deg) {
  return std::abs(std::remainder(a_deg - b_deg, whole_turn_deg));
}

}  // namespace lapservo::internal
