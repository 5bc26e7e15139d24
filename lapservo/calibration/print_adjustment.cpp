#include "lapservo/calibration/print_adjustment.h"

#include <algorithm>
#include <array>
#include <ceres/ceres.h>
#include <cmath>
#include <cstddef>
#include <utility>

#include "lapservo/calibration/robust_scale.h"
#include "lapservo/calibration/solve_quietly.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/vision/common_errors.h"
#include "lapservo/vision/limits.h"

namespace lapservo::internal {
namespace {

constexpr double mm = 1e-3;
// Of a frame: its pose and, as in every fit of the tracker, the film's thickness in film_sigma_m.
constexpr int frame_numbers = 7, film = 6;
// After the print's numbers (lengths in mm): what all films are off by, in film_sigma_m, and all sides, the seam's
// edges and each boundary, in all frames alike [px]; and by how much the seam's edges stay behind their motion [px].
constexpr int shared_film = print_numbers, sides = shared_film + 1, seam = sides + 1, boundaries = seam + 2;
constexpr int seam_lag = boundaries + 4, shared_numbers = seam_lag + 1;
constexpr int gap = print_numbers - 1;
constexpr std::size_t upper_group = measurement_groups, groups = measurement_groups + 2;

// Before the fit, one sigma: how far a print may be off; and what the model leaves out of every frame alike, which is
// taken for zero: to tell it from so many frames would be to believe the model to a thousandth of a pixel.
constexpr double print_prior_mm = 2, gap_prior_rad = 0.5;
// From the film on. Measured on rendered frames: sides up to 0.08 px, an end whose face is seen up to 0.1 px, inner
// boundaries 0.01 px.
constexpr std::array shared_sigmas{1.0, 0.05, 0.03, 0.03, 0.05, 0.01, 0.01, 0.05};
constexpr double zero = 1e-3;            // of these
constexpr double common_seam_px = 0.03;  // of one frame
// Compressed video leaves the seam's edges 0.05 to 0.14 px behind and the bands' boundaries, which move less, 0.02 px
// at most. A turn there and back tells by how much; one of one way can't tell it from a seam that lies elsewhere.
constexpr double seam_lag_px = 0.1, seam_lag_from_px = 0.2;
constexpr std::ptrdiff_t min_seam_views_each_way = 3;
constexpr double min_noise_of_lag = 0.3;  // of edges, beyond the usual

using SharedRow = std::array<double, shared_numbers>;

// (row . frame + shared_row . shared + common - residual) / sigma.
class LinearCost : public ceres::SizedCostFunction<1, frame_numbers, shared_numbers, 1> {
 public:
  LinearCost(const UnknownVector& row, const SharedRow& shared, double residual_px, double sigma_px)
      : shared_(shared), residual_px_(residual_px), per_sigma_(1 / sigma_px) {
    for (Eigen::Index i = 0; i < row.size(); ++i) row_[static_cast<std::size_t>(i)] = row[i];
  }
  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    double predicted = parameters[2][0];
    for (std::size_t i = 0; i < row_.size(); ++i) predicted += row_[i] * parameters[0][i];
    for (std::size_t i = 0; i < shared_.size(); ++i) predicted += shared_[i] * parameters[1][i];
    residuals[0] = per_sigma_ * (predicted - residual_px_);
    if (!jacobians) return true;
    if (jacobians[0])
      for (std::size_t i = 0; i < row_.size(); ++i) jacobians[0][i] = per_sigma_ * row_[i];
    if (jacobians[1])
      for (std::size_t i = 0; i < shared_.size(); ++i) jacobians[1][i] = per_sigma_ * shared_[i];
    if (jacobians[2]) jacobians[2][0] = per_sigma_;
    return true;
  }
  double residual_px(const double* frame, const double* shared, double common) const {
    const double* const parameters[] = {frame, shared, &common};
    double residual = 0;
    Evaluate(parameters, &residual, nullptr);
    return -residual / per_sigma_;
  }
  double sigma_px() const { return 1 / per_sigma_; }

 private:
  std::array<double, frame_numbers> row_{};
  SharedRow shared_;
  double residual_px_, per_sigma_;
};

// (value - expected) / sigma of one number of a block.
class Prior : public ceres::CostFunction {
 public:
  Prior(int size, int index, double expected, double sigma)
      : index_(index), expected_(expected), per_sigma_(1 / sigma) {
    set_num_residuals(1);
    mutable_parameter_block_sizes()->push_back(size);
  }
  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    residuals[0] = per_sigma_ * (parameters[0][index_] - expected_);
    if (!jacobians || !jacobians[0]) return true;
    std::fill_n(jacobians[0], parameter_block_sizes()[0], 0.0);
    jacobians[0][index_] = per_sigma_;
    return true;
  }

 private:
  int index_;
  double expected_, per_sigma_;
};

// d(position)/d(shared numbers) of a point of an edge.
SharedRow shared_row(const Measurement& m, const PrintShape& shape, double covered_rad) {
  SharedRow row{};
  row[shared_film] = m.row[film];
  if (m.group >= 4) {
    row[sides] = 1;
    return row;
  }
  const std::size_t k = m.group;
  const double along = mm * m.along_px_per_m;
  row[boundaries + k] = 1;
  if (k > 0) row[k - 1] = along * (1 - m.turn_fraction);
  row[3 + k] = along * m.turn_fraction;
  // A wider gap leaves less around the shaft for the same print.
  row[gap] = m.along_px_per_m * (shape.lower_m[k] - shape.upper_m[k]) * m.turn_fraction / covered_rad;
  return row;
}

double moved_px(const SeamEdge& edge, double turned_rad) {
  return edge.row[edge.row.size() - 1] * turned_rad;
}

SharedRow shared_row(const SeamEdge& edge, bool lower, double turned_rad) {
  SharedRow row{};
  const double along_px = moved_px(edge, turned_rad);
  row[seam_lag] = -along_px / std::hypot(along_px, seam_lag_from_px);
  row[gap] = edge.by_gap_px;
  row[lower ? seam + 1 : seam] = 1;
  return row;
}

struct FrameBlocks {
  std::array<double, frame_numbers> frame{};
  std::array<double, groups> common{};
  std::vector<LinearCost*> edges, seam;  // owned by the problem
  std::vector<std::size_t> edge_groups;
};

double common_sigma_px(std::size_t group, const ViewMeasurements& frame) {
  const double more_px =
      fine_fit_limits.common_fraction_of_blur * std::max(0.0, frame.blur_px - fine_fit_limits.usual_blur_px);
  if (group >= measurement_groups) return common_seam_px + more_px;
  const double usual_px = group < 4 ? fine_fit_limits.common_boundary_px : fine_fit_limits.common_side_px;
  return std::hypot(usual_px + more_px, fine_fit_limits.fraction_of_processing * frame.bias_px[group]);
}

void add_frame(ceres::Problem& problem, const ViewMeasurements& frame, const PrintShape& shape, double covered_rad,
               double loss_scale_sigmas, std::array<double, shared_numbers>& shared, FrameBlocks& blocks) {
  const auto add = [&](LinearCost* cost, std::size_t group) {
    problem.AddResidualBlock(cost, new ceres::CauchyLoss(loss_scale_sigmas), blocks.frame.data(), shared.data(),
                             &blocks.common[group]);
  };
  problem.AddResidualBlock(new Prior(frame_numbers, film, (film_mean_m - frame.film_m) / film_sigma_m, 1), nullptr,
                           blocks.frame.data());
  std::array<bool, groups> used{};
  for (const Measurement& m : frame.edges.all) {
    auto* cost = new LinearCost(m.row, shared_row(m, shape, covered_rad), m.residual_px, m.sigma_px);
    blocks.edges.push_back(cost), blocks.edge_groups.push_back(m.group);
    add(cost, m.group), used[m.group] = true;
  }
  const auto add_seam = [&](const std::optional<SeamEdge>& edge, std::size_t group) {
    if (!edge) return;
    auto* cost = new LinearCost(edge->row, shared_row(*edge, group != upper_group, frame.turned_rad), edge->residual_px,
                                edge->sigma_px);
    blocks.seam.push_back(cost);
    add(cost, group), used[group] = true;
  };
  if (frame.seam) add_seam(frame.seam->upper, upper_group), add_seam(frame.seam->lower, upper_group + 1);
  for (std::size_t group = 0; group < groups; ++group)
    if (used[group])
      problem.AddResidualBlock(new Prior(1, 0, 0, common_sigma_px(group, frame)), nullptr, &blocks.common[group]);
}

// Views that hardly moved tell no lag, and which way they did is their poses' error as well.
bool tells_lag(const std::vector<ViewMeasurements>& frames) {
  const auto views = [&](double way) {
    return std::count_if(frames.begin(), frames.end(), [=](const ViewMeasurements& frame) {
      if (!frame.seam || !(way * frame.turned_rad > 0)) return false;
      const auto& edge = frame.seam->upper ? frame.seam->upper : frame.seam->lower;
      return edge && std::abs(moved_px(*edge, frame.turned_rad)) > seam_lag_from_px;
    });
  };
  return std::min(views(1), views(-1)) >= min_seam_views_each_way;
}

void add_priors(ceres::Problem& problem, std::array<double, shared_numbers>& shared, bool free_lag) {
  const auto add = [&](int index, double sigma) {
    problem.AddResidualBlock(new Prior(shared_numbers, index, 0, sigma), nullptr, shared.data());
  };
  for (int i = 0; i < gap; ++i) add(i, print_prior_mm);
  add(gap, gap_prior_rad);
  for (int i = shared_film; i < seam_lag; ++i) add(i, zero * shared_sigmas[static_cast<std::size_t>(i - shared_film)]);
  add(seam_lag, free_lag ? seam_lag_px : zero * seam_lag_px);
}

double sigma_of_edges_px(const std::vector<ViewMeasurements>& frames) {
  std::vector<double> sigmas_px;
  for (const ViewMeasurements& frame : frames)
    for (const Measurement& m : frame.edges.all)
      if (m.group < 4) sigmas_px.push_back(m.sigma_px);
  return sigmas_px.empty() ? fine_fit_limits.usual_sigma_px : median(sigmas_px);
}

// By how much edges are noisier than usual: those of compressed pictures are.
double noise_beyond_usual(double sigma_px) {
  return std::max(0.0, sigma_px / fine_fit_limits.usual_sigma_px - 1);
}

// As the tracker has it, in all frames alike.
double common_doubt_scale(const std::vector<ViewMeasurements>& frames, double edges_px) {
  std::vector<double> blurs_px, biases_px;
  for (const ViewMeasurements& frame : frames) {
    blurs_px.push_back(frame.blur_px);
    biases_px.push_back(Eigen::Map<const Eigen::Vector4d>(frame.bias_px.data()).norm() / 2);
  }
  if (blurs_px.empty()) return 1;
  return doubt_scale(edges_px, median(blurs_px), median(biases_px));
}

// One sigma of what was taken for zero in all frames, from the film on.
Eigen::VectorXd sigmas_of_common(const std::vector<ViewMeasurements>& frames, double edges_px, bool free_lag) {
  const auto known = static_cast<Eigen::Index>(shared_sigmas.size());
  Eigen::VectorXd sigmas(free_lag ? known : known + 1);
  sigmas.head(known) =
      common_doubt_scale(frames, edges_px) * Eigen::Map<const Eigen::VectorXd>(shared_sigmas.data(), known);
  sigmas[0] = shared_sigmas[0];  // the film is as thick in any picture
  if (!free_lag) sigmas[known] = seam_lag_px * std::min(1.0, noise_beyond_usual(edges_px));
  return sigmas;
}

// The print's; what was taken for zero in all frames, by `prior`, counts as it was before the fit.
std::optional<PrintCovariance> covariance_of(ceres::Problem& problem, const std::array<double, shared_numbers>& shared,
                                             bool free_gap, double noise_scale, const Eigen::VectorXd& prior) {
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::SPARSE_QR;
  ceres::Covariance covariance(options);
  const std::vector<std::pair<const double*, const double*>> blocks{{shared.data(), shared.data()}};
  if (!covariance.Compute(blocks, &problem)) return std::nullopt;
  Eigen::Matrix<double, shared_numbers, shared_numbers, Eigen::RowMajor> all;
  if (!covariance.GetCovarianceBlock(shared.data(), shared.data(), all.data())) return std::nullopt;
  const Eigen::Index common = prior.size();
  const PrintCovariance joint = all.topLeftCorner<print_numbers, print_numbers>();
  const Eigen::MatrixXd cross = all.block(0, shared_film, print_numbers, common);
  const Eigen::MatrixXd of_common = all.block(shared_film, shared_film, common, common);
  const Eigen::MatrixXd by_common = solve_symmetric(of_common, cross.transpose()).transpose();
  const PrintCovariance known = joint - by_common * cross.transpose();  // were the common errors known
  const PrintCovariance print = std::max(1.0, noise_scale * noise_scale) * known +
                                by_common * prior.cwiseAbs2().asDiagonal() * by_common.transpose();
  PrintNumbers units = PrintNumbers::Constant(mm);
  units[gap] = free_gap ? 1 : 0;
  const PrintCovariance scaled = units.asDiagonal() * print * units.asDiagonal();
  return scaled.allFinite() ? std::optional(scaled) : std::nullopt;
}

}  // namespace

std::optional<Adjustment> adjust(const std::vector<ViewMeasurements>& frames, const Marker& marker,
                                 const AdjustmentOptions& options) {
  std::array<double, shared_numbers> shared{};
  std::vector<FrameBlocks> blocks(frames.size());
  ceres::Problem problem;
  problem.AddParameterBlock(shared.data(), shared_numbers);
  const bool free_lag = tells_lag(frames);
  add_priors(problem, shared, free_lag);
  const PrintShape shape = PrintShape::of(marker);
  for (std::size_t i = 0; i < frames.size(); ++i)
    add_frame(problem, frames[i], shape, marker.covered_rad(), options.loss_scale_sigmas, shared, blocks[i]);
  std::vector<int> fixed;
  if (!options.free_print)
    for (int i = 0; i < print_numbers; ++i) fixed.push_back(i);
  else if (!options.free_gap)
    fixed.push_back(gap);
  if (!fixed.empty()) problem.SetManifold(shared.data(), new ceres::SubsetManifold(shared_numbers, fixed));

  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  solver.max_num_iterations = 30;
  solver.function_tolerance = 1e-9;
  ceres::Solver::Summary summary;
  if (!solve_quietly(solver, problem, summary)) return std::nullopt;

  Adjustment result;
  const double edges_px = sigma_of_edges_px(frames);
  result.lags = !free_lag && noise_beyond_usual(edges_px) > min_noise_of_lag;
  for (int i = 0; i < print_numbers; ++i) result.print[i] = shared[static_cast<std::size_t>(i)] * (i == gap ? 1 : mm);
  std::vector<double> sigmas;
  for (const FrameBlocks& frame : blocks) {
    result.steps.push_back(Eigen::Map<const Eigen::Matrix<double, frame_numbers, 1>>(frame.frame.data()));
    auto& residuals_px = result.residuals_px.emplace_back();
    for (std::size_t i = 0; i < frame.edges.size(); ++i) {
      const std::size_t group = frame.edge_groups[i];
      residuals_px.push_back(frame.edges[i]->residual_px(frame.frame.data(), shared.data(), frame.common[group]));
      if (group < 4) sigmas.push_back(residuals_px.back() / frame.edges[i]->sigma_px());
    }
  }
  result.noise_scale = robust_scale(std::move(sigmas));
  if (options.with_covariance) {
    result.covariance = covariance_of(problem, shared, options.free_gap, result.noise_scale,
                                      sigmas_of_common(frames, edges_px, free_lag));
    if (!result.covariance) return std::nullopt;
  }
  return result;
}

}  // namespace lapservo::internal
