#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <type_traits>

#include <Eigen/Core>

#include "lapservo/geometry/response.h"

namespace lapservo::internal {

/// A response as value = s + sum of c_k B_k(s): s the light as sRGB encodes it (0 to 1), B_k cubic B-splines over equal
/// parts of [0, 1] without those that move the ends, c_k the curve's numbers.
inline constexpr int curve_parts = 8, curve_numbers = curve_parts + 1;
using ResponseCurve = Eigen::Matrix<double, curve_numbers, 1>;

/// sRGB without an end: of numbers and of ceres::Jet.
template <typename T>
T srgb_value(const T& light) {
  using std::pow;
  if (light <= 0.0031308) return light * 12.92;
  return T(1.055) * pow(light, 1 / 2.4) - T(0.055);
}

/// The value (0 to 1) at a light, by a curve's numbers; sRGB's beyond [0, 1].
template <typename T>
T value_by_curve(const T* curve, const T& light) {
  const T s = srgb_value(light);
  if (s <= 0.0 || s >= 1.0) return s;
  // de Boor on the clamped knots: four splines differ from zero.
  double at;
  if constexpr (std::is_same_v<T, double>)
    at = s;
  else
    at = s.a;
  const int part = std::min(curve_parts - 1, static_cast<int>(at * curve_parts));
  const auto knot = [](int i) { return static_cast<double>(std::clamp(i, 0, curve_parts)) / curve_parts; };
  T d[4];
  for (int j = 0; j < 4; ++j) {
    const int k = part + j - 1;  // the first and the last spline of all are left out
    d[j] = k < 0 || k >= curve_numbers ? T(0) : curve[k];
  }
  for (int r = 1; r <= 3; ++r)
    for (int j = 3; j >= r; --j) {
      const double low = knot(part - 3 + j), high = knot(part + 1 + j - r);
      const T alpha = (s - low) / (high - low);
      d[j] = (T(1) - alpha) * d[j - 1] + alpha * d[j];
    }
  return s + d[3];
}

/// B_k at a light: derivatives of its value by the curve's numbers.
ResponseCurve splines_at(double light);

/// The curve that comes nearest to value = value_of(s).
ResponseCurve nearest_curve(const std::function<double(double)>& value_of);

/// Even in what sRGB makes of light: fine in the dark. Rises everywhere, from 0 to 1.
Response table_of(const ResponseCurve& curve);

/// Prior of cameras' curves, where images leave it open: standard ones, with contrast (a logistic curve about a middle)
/// and shoulders of several strengths; and the deviation from all of these. `whitening` times a curve's difference from
/// `mean` has a standard deviation of 1 in each element; it is upper triangular.
struct UsualCurves {
  ResponseCurve mean = ResponseCurve::Zero();
  Eigen::Matrix<double, curve_numbers, curve_numbers> whitening;
};
UsualCurves usual_curves();

}  // namespace lapservo::internal
