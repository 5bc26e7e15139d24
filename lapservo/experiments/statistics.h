#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "lapservo/core/statistics.h"

namespace lapservo::internal {

/// Statistics of a list of numbers: all zero when it is empty.
struct Spread {
  std::size_t count = 0;
  double mean = 0;
  double deviation = 0;  ///< standard deviation about the mean, of the sample (n - 1)
  double rms = 0;
  double largest = 0;  ///< magnitude
  double median = 0;
};
Spread spread_of(std::vector<double> values);

/// The fraction of the magnitudes that is smaller than a bound; 0 for an empty list.
double fraction_within(const std::vector<double>& values, double bound);

/// A number with the given count of digits, or more where a whole number has more; no exponent.
std::string with_digits(double value, int digits);

/// "1.49 ± 1.2 px": three digits of the mean, two of the deviation.
std::string mean_and_deviation(const Spread& spread, const char* unit);

/// Distance of each point to the centroid of all.
std::vector<double> distances_to_centroid(const std::vector<Eigen::Vector2d>& points);

}  // namespace lapservo::internal
