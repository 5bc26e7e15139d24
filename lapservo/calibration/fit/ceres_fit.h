#pragma once

#include <ceres/ceres.h>
#include <optional>
#include <utility>
#include <vector>

#include "lapservo/calibration/fit/at_iteration.h"
#include "lapservo/core/departures.h"

namespace lapservo::internal {

/// The options of ceres::Solver that differ between fits.
struct SolverChoice {
  ceres::LinearSolverType linear_solver = ceres::DENSE_QR;
  int max_iterations = 50;
  double function_tolerance = 1e-6;
};

/// Ceres' solver without a word on stderr: what it complains of, its results say. The same to the last bit, every time.
ceres::Solver::Summary solve_quietly(const SolverChoice& choice, ceres::Problem& problem,
                                     const AtIteration& at_iteration);

/// Covariance of these blocks, one after the other, for residuals of unit sigma; 0 of those that are constant. Nullopt
/// where the residuals leave a number open.
std::optional<Eigen::MatrixXd> covariance_of(ceres::Problem& problem, const std::vector<const double*>& blocks);

/// The numbers that Ceres fits: the columns of a Jacobian.
class FittedNumbers {
 public:
  explicit FittedNumbers(const ceres::Problem& problem) : problem_(problem) {}

  /// Appends a block, unless it is constant or no residual depends on it.
  void add(double* block);
  /// The part of a covariance of all numbers that belongs to these blocks, in their order; 0 where one is not fitted.
  Eigen::MatrixXd part_of(const Eigen::MatrixXd& covariance, const std::vector<const double*>& blocks) const;
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
