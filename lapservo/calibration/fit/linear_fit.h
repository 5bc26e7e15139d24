#pragma once

#include <ceres/ceres.h>
#include <optional>
#include <utility>
#include <vector>

#include "lapservo/core/departures.h"

namespace lapservo::internal {

/// The numbers that Ceres fits: the columns of a Jacobian.
class FittedNumbers {
 public:
  explicit FittedNumbers(const ceres::Problem& problem) : problem_(problem) {}

  /// Appends a block, unless it is constant or no residual depends on it.
  void add(double* block);
  /// Its first column; nullopt where it is not fitted.
  std::optional<Eigen::Index> column(const double* block) const;
  const std::vector<double*>& blocks() const { return blocks_; }
  Eigen::Index size() const { return size_; }

 private:
  const ceres::Problem& problem_;
  std::vector<double*> blocks_;
  std::vector<std::pair<const double*, Eigen::Index>> first_;
  Eigen::Index size_ = 0;
};

/// Residuals in the order in which they were added, each as far as its loss trusts it; their noise is 1.
LinearFit linear_fit(ceres::Problem& problem, const FittedNumbers& numbers);

}  // namespace lapservo::internal
