#include "lapservo/calibration/fit/linear_fit.h"

#include <iterator>

namespace lapservo::internal {

void FittedNumbers::add(double* block) {
  if (!problem_.HasParameterBlock(block) || problem_.IsParameterBlockConstant(block)) return;
  blocks_.push_back(block), first_.emplace_back(block, size_);
  size_ += problem_.ParameterBlockTangentSize(block);
}

std::optional<Eigen::Index> FittedNumbers::column(const double* block) const {
  for (const auto& [one, column] : first_)
    if (one == block) return column;
  return std::nullopt;
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
