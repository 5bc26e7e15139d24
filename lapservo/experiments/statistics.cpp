#include "lapservo/experiments/statistics.h"

#include <algorithm>
#include <cmath>

namespace lapservo {

Spread spread_of(std::vector<double> values) {
  Spread spread;
  spread.count = values.size();
  if (values.empty()) return spread;
  const auto n = static_cast<double>(values.size());
  double squares = 0;
  for (const double value : values) {
    spread.mean += value / n;
    squares += value * value;
    spread.largest = std::max(spread.largest, std::abs(value));
  }
  spread.rms = std::sqrt(squares / n);
  double about_mean = 0;
  for (const double value : values) about_mean += (value - spread.mean) * (value - spread.mean);
  if (values.size() > 1) spread.deviation = std::sqrt(about_mean / (n - 1));
  std::sort(values.begin(), values.end());
  spread.median = 0.5 * (values[(values.size() - 1) / 2] + values[values.size() / 2]);
  return spread;
}

std::vector<double> distances_to_centroid(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Vector2d centroid = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& point : points) centroid += point / static_cast<double>(points.size());
  std::vector<double> distances;
  for (const Eigen::Vector2d& point : points) distances.push_back((point - centroid).norm());
  return distances;
}

}  // namespace lapservo
