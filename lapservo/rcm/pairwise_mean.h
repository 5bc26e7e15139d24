#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "lapservo/rcm/line_observation.h"

namespace lapservo::internal {

struct PairwiseMean {
  Eigen::Vector2d point_px = Eigen::Vector2d::Zero();
  /// Jackknife over the lines (the intersections of one line are not independent of each other): a guess, since a mean
  /// of ratios need not have a variance. Absent with two lines.
  std::optional<Eigen::Matrix2d> covariance_px2;
  std::size_t pairs = 0;
};

/// The projected RCM as the paper has it (eq. 9, section II-C): the mean of the intersections of all pairs of lines.
/// Every pair counts the same, also one that is nearly parallel and meets anywhere: kept as the baseline, use
/// estimate_projected_rcm(). nullopt when no two usable lines meet. Takes time with the square of the lines.
std::optional<PairwiseMean> mean_of_intersections(std::span<const LineObservation> lines);

}  // namespace lapservo::internal
