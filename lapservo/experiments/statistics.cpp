#include "lapservo/experiments/statistics.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "lapservo/core/statistics.h"

namespace lapservo::internal {

Spread spread_of(std::vector<double> values) {
  Spread spread;
  spread.count = values.size();
  if (values.empty()) return spread;
  const auto n = static_cast<double>(values.size());
  spread.mean = spread.largest = 0;
  for (const double value : values) {
    spread.mean += value / n;
    spread.largest = std::max(spread.largest, std::abs(value));
  }
  spread.rms = rms(values);
  double about_mean = 0;
  for (const double value : values) about_mean += (value - spread.mean) * (value - spread.mean);
  if (values.size() > 1) spread.deviation = std::sqrt(about_mean / (n - 1));
  spread.median = quantile_of(std::move(values), 0.5);
  return spread;
}

double fraction_within(const std::vector<double>& values, double bound) {
  if (values.empty()) return std::nan("");
  const auto within = std::count_if(values.begin(), values.end(), [bound](double v) { return std::abs(v) < bound; });
  return static_cast<double>(within) / static_cast<double>(values.size());
}

std::string with_digits(double value, int digits) {
  if (!std::isfinite(value)) return unknown_text;
  const double power = value == 0 ? 0 : std::floor(std::log10(std::abs(value)));
  return fmt::format("{:.{}f}", value, static_cast<int>(std::clamp(digits - 1 - power, 0.0, 9.0)));
}

std::string mean_and_deviation(const Spread& spread, const char* unit) {
  return fmt::format("{} \u00b1 {} {}", with_digits(spread.mean, 3), with_digits(spread.deviation, 2), unit);
}

std::vector<double> distances_to_centroid(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Vector2d centroid = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& point : points) centroid += point / static_cast<double>(points.size());
  std::vector<double> distances;
  for (const Eigen::Vector2d& point : points) distances.push_back((point - centroid).norm());
  return distances;
}

}  // namespace lapservo::internal
