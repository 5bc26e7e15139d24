#include "lapservo/rcm/pairwise_mean.h"

#include <vector>

namespace lapservo::internal {
namespace {

struct Sum {
  Eigen::Vector2d points_px = Eigen::Vector2d::Zero();
  double count = 0;

  void add(const Eigen::Vector2d& point_px) {
    points_px += point_px;
    ++count;
  }
};

// Delete-one jackknife: the spread of the means without one of the lines.
std::optional<Eigen::Matrix2d> jackknife(const Sum& total, const std::vector<Sum>& by_line) {
  std::vector<Eigen::Vector2d> without;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Sum& line : by_line) {
    if (!(total.count > line.count)) return std::nullopt;
    without.emplace_back((total.points_px - line.points_px) / (total.count - line.count));
    mean += without.back() / static_cast<double>(by_line.size());
  }
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector2d& point : without) scatter += (point - mean) * (point - mean).transpose();
  const auto n = static_cast<double>(by_line.size());
  return Eigen::Matrix2d((n - 1) / n * scatter);
}

}  // namespace

std::optional<PairwiseMean> mean_of_intersections(std::span<const LineObservation> lines) {
  Sum total;
  std::vector<Sum> by_line(lines.size());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (!is_usable(lines[i])) continue;
    for (std::size_t k = i + 1; k < lines.size(); ++k) {
      if (!is_usable(lines[k])) continue;
      const auto point = intersection_px(lines[i], lines[k]);
      if (!point) continue;
      total.add(*point), by_line[i].add(*point), by_line[k].add(*point);
    }
  }
  if (!(total.count > 0)) return std::nullopt;
  std::erase_if(by_line, [](const Sum& line) { return line.count == 0; });
  return PairwiseMean{total.points_px / total.count, jackknife(total, by_line), static_cast<std::size_t>(total.count)};
}

}  // namespace lapservo::internal
