#include "lapservo/calibration/fit/ceres_fit.h"

#include <algorithm>
#include <exception>
#include <glog/logging.h>
#include <iterator>

namespace lapservo::internal {
namespace {

// Ceres need not know of exceptions.
class Calling : public ceres::IterationCallback {
 public:
  explicit Calling(const AtIteration& at_iteration) : at_iteration_(at_iteration) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    try {
      at_iteration_();
    } catch (...) {
      thrown = std::current_exception();
      return ceres::SOLVER_ABORT;
    }
    return ceres::SOLVER_CONTINUE;
  }
  std::exception_ptr thrown;

 private:
  const AtIteration& at_iteration_;
};

}  // namespace

ceres::Solver::Summary solve_quietly(const SolverChoice& choice, ceres::Problem& problem,
                                     const AtIteration& at_iteration) {
  [[maybe_unused]] static const int quiet = FLAGS_minloglevel = google::GLOG_FATAL;  // once: fits run side by side
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;  // else sums differ from time to time
  options.linear_solver_type = choice.linear_solver;
  options.max_num_iterations = choice.max_iterations;
  options.function_tolerance = choice.function_tolerance;
  Calling calling(at_iteration);
  if (at_iteration) options.callbacks.push_back(&calling);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (calling.thrown) std::rethrow_exception(calling.thrown);
  return summary;
}

std::optional<Eigen::MatrixXd> covariance_of(ceres::Problem& problem, const std::vector<const double*>& blocks) {
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::SPARSE_QR;
  ceres::Covariance covariance(options);
  if (!covariance.Compute(blocks, &problem)) return std::nullopt;
  int size = 0;
  for (const double* block : blocks) size += problem.ParameterBlockSize(block);
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> all(size, size);
  return covariance.GetCovarianceMatrix(blocks, all.data()) ? std::optional<Eigen::MatrixXd>(all) : std::nullopt;
}

void FittedNumbers::add(double* block) {
  if (!problem_.HasParameterBlock(block) || problem_.IsParameterBlockConstant(block)) return;
  blocks_.push_back(block), first_.emplace_back(block, size_);
  size_ += problem_.ParameterBlockTangentSize(block);
}

Eigen::MatrixXd FittedNumbers::part_of(const Eigen::MatrixXd& covariance,
                                       const std::vector<const double*>& blocks) const {
  std::vector<Eigen::Index> places;  // -1: not fitted
  for (const double* block : blocks) {
    const auto fitted = std::ranges::find(first_, block, &std::pair<const double*, Eigen::Index>::first);
    for (int i = 0; i < problem_.ParameterBlockSize(block); ++i)
      places.push_back(fitted == first_.end() ? -1 : fitted->second + i);
  }
  const auto size = std::ssize(places);
  return Eigen::MatrixXd::NullaryExpr(size, size, [&](Eigen::Index i, Eigen::Index k) {
    const auto row = places[static_cast<std::size_t>(i)], column = places[static_cast<std::size_t>(k)];
    return row < 0 || column < 0 ? 0 : covariance(row, column);
  });
}

LinearFit linear_fit(ceres::Problem& problem, const FittedNumbers& numbers) {
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = numbers.blocks();
  ceres::CRSMatrix rows;
  std::vector<double> residuals;
  problem.Evaluate(options, nullptr, &residuals, nullptr, &rows);
  LinearFit fit;
  fit.noise = 1;
  fit.residuals = Eigen::Map<const Eigen::VectorXd>(residuals.data(), static_cast<Eigen::Index>(residuals.size()));
  fit.jacobian = Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>>(
      rows.num_rows, rows.num_cols, std::ssize(rows.values), rows.rows.data(), rows.cols.data(), rows.values.data());
  return fit;
}

}  // namespace lapservo::internal
