#pragma once

#include <cmath>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lapservo/core/statistics.h"

namespace lapservo::internal {

/// Statistics of a list of numbers. One that needs more numbers than there are is NaN: not known.
struct Spread {
  std::size_t count = 0;
  double mean = std::nan("");
  double deviation = mean;  ///< standard deviation about the mean, of the sample (n - 1); of two numbers or more
  double rms = mean;
  double largest = mean;  ///< magnitude
  double median = mean;
};
Spread spread_of(std::vector<double> values);

/// The fraction of the magnitudes that is smaller than a bound; NaN for an empty list.
double fraction_within(const std::vector<double>& values, double bound);

/// Stands in tables for a number that is not known.
inline constexpr const char* unknown_text = "\u2013";

/// A number with the given count of digits, or more where a whole number has more; no exponent. unknown_text where it
/// is not finite.
std::string with_digits(double value, int digits);

/// "1.49 ± 1.2 px": three digits of the mean, two of the deviation.
std::string mean_and_deviation(const Spread& spread, const char* unit);

/// Distance of each point to the centroid of all.
std::vector<double> distances_to_centroid(const std::vector<Eigen::Vector2d>& points);

}  // namespace lapservo::internal
