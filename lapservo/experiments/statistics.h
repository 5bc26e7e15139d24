#pragma once

#include <vector>

#include <Eigen/Core>

namespace lapservo {

/// Of a list of numbers: all zero when it is empty.
struct Spread {
  std::size_t count = 0;
  double mean = 0;
  double deviation = 0;  ///< standard deviation about the mean, of the sample (n - 1)
  double rms = 0;
  double largest = 0;  ///< magnitude
  double median = 0;
};
Spread spread_of(std::vector<double> values);

/// Distance of each point to the centroid of all.
std::vector<double> distances_to_centroid(const std::vector<Eigen::Vector2d>& points);

}  // namespace lapservo
