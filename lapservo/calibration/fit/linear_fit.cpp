#include "lapservo/calibration/fit/linear_fit.h"

#include <cstddef>

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
  std::vector<Eigen::Triplet<double>> entries;
  for (int row = 0; row < rows.num_rows; ++row)
    for (auto k = static_cast<std::size_t>(rows.rows[static_cast<std::size_t>(row)]);
         k < static_cast<std::size_t>(rows.rows[static_cast<std::size_t>(row) + 1]); ++k)
      entries.emplace_back(row, rows.cols[k], rows.values[k]);
  fit.jacobian.resize(rows.num_rows, rows.num_cols);
  fit.jacobian.setFromTriplets(entries.begin(), entries.end());
  return fit;
}

}  // namespace lapservo::internal
