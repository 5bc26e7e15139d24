#include "lapservo/calibration/marker/frame_fit.h"

#include <algorithm>
#include <ceres/ceres.h>
#include <ceres/normal_prior.h>
#include <cmath>

#include "lapservo/calibration/fit/ceres_fit.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/statistics.h"

namespace lapservo::internal {
namespace {

// Residuals and their derivatives at x, which all frames' cost functions read.
struct Linearisation : ceres::EvaluationCallback {
  Linearisation(const FrameResiduals& of, const std::vector<Unknown>& numbers, const Eigen::VectorXd& starts,
                std::size_t held_numbers)
      : model(of),
        unknowns(numbers),
        held(starts.tail(static_cast<Eigen::Index>(held_numbers))),
        x(starts.head(starts.size() - held.size())),
        residuals(model(starts)) {}

  const FrameResiduals& model;
  const std::vector<Unknown>& unknowns;  // those that are fitted, then those that are held
  const Eigen::VectorXd held;
  Eigen::VectorXd x;
  Eigen::MatrixXd residuals;
  std::vector<Eigen::MatrixXd> slopes;  // one a number that is fitted, as residuals

  void PrepareForEvaluation(bool with_slopes, bool) override {
    residuals = model(with_held());
    if (!with_slopes) return;
    slopes.clear();
    for (Eigen::Index i = 0; i < x.size(); ++i) slopes.push_back(slope(i));
  }

  Eigen::VectorXd with_held() const {
    Eigen::VectorXd all(x.size() + held.size());
    all << x, held;
    return all;
  }

  Eigen::MatrixXd slope(Eigen::Index of) const {
    const double size = unknowns[static_cast<std::size_t>(of)].step;
    const Eigen::VectorXd all = with_held(), step = size * Eigen::VectorXd::Unit(all.size(), of);
    return (model(all + step) - model(all - step)) / (2 * size);
  }

  // Derivatives of one frame: channels x numbers.
  Eigen::MatrixXd jacobian(Eigen::Index frame) const {
    Eigen::MatrixXd result(residuals.rows(), static_cast<Eigen::Index>(slopes.size()));
    for (Eigen::Index i = 0; i < result.cols(); ++i) result.col(i) = slopes[static_cast<std::size_t>(i)].col(frame);
    return result;
  }
};

class FrameCost : public ceres::CostFunction {
 public:
  FrameCost(const Linearisation& at, Eigen::Index frame, const Eigen::VectorXd& weights)
      : at_(at), frame_(frame), weights_(weights) {
    set_num_residuals(static_cast<int>(weights.size()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(at.x.size()));
  }
  bool Evaluate(double const* const*, double* residuals, double** jacobians) const override {
    using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    Eigen::Map<Eigen::VectorXd>(residuals, weights_.size()) = weights_.cwiseProduct(at_.residuals.col(frame_));
    if (jacobians && jacobians[0])
      Eigen::Map<Rows>(jacobians[0], weights_.size(), parameter_block_sizes()[0]) =
          weights_.asDiagonal() * at_.jacobian(frame_);
    return at_.residuals.col(frame_).allFinite();
  }

 private:
  const Linearisation& at_;
  Eigen::Index frame_;
  const Eigen::VectorXd& weights_;
};

Eigen::VectorXd inverse_priors(const std::vector<Unknown>& unknowns, Eigen::Index fitted) {
  Eigen::VectorXd inverse(fitted);
  for (Eigen::Index i = 0; i < fitted; ++i) {
    const double prior = unknowns[static_cast<std::size_t>(i)].prior;
    inverse[i] = prior > 0 ? 1 / prior : 0;
  }
  return inverse;
}

// Cauchy's scale in root mean squares of a frame's residuals.
double loss_scale(Eigen::Index channels) {
  return 2.5 * std::sqrt(static_cast<double>(channels));
}

bool solve(Linearisation& at, const Eigen::VectorXd& weights, const AtIteration& at_iteration) {
  ceres::Problem::Options options;
  options.evaluation_callback = &at;
  ceres::CauchyLoss loss(loss_scale(weights.size()));
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(options);
  for (Eigen::Index i = 0; i < at.residuals.cols(); ++i)
    problem.AddResidualBlock(new FrameCost(at, i, weights), &loss, at.x.data());
  const Eigen::VectorXd priors = inverse_priors(at.unknowns, at.x.size());
  problem.AddResidualBlock(new ceres::NormalPrior(priors.asDiagonal(), Eigen::VectorXd::Zero(priors.size())), nullptr,
                           at.x.data());
  const SolverChoice solver{ceres::DENSE_NORMAL_CHOLESKY, 100, 1e-12};  // what priors alone hold costs next to nothing
  return solve_quietly(solver, problem, at_iteration).IsSolutionUsable() && at.x.allFinite();
}

Eigen::VectorXd robust_scales(const Eigen::MatrixXd& residuals) {
  Eigen::VectorXd scales(residuals.rows());
  for (Eigen::Index c = 0; c < residuals.rows(); ++c) {
    const Eigen::VectorXd channel = residuals.row(c);
    scales[c] = std::max(1e-3, robust_scale({channel.begin(), channel.end()}));
  }
  return scales;
}

// The fit, but for what priors hold of its numbers, and the window of lags take a part of the scatter away: times its
// variance.
double freedom_of(Eigen::Index frames, double numbers, std::size_t alike_frames) {
  const double taken = numbers + static_cast<double>(alike_frames);
  return static_cast<double>(frames) / std::max(1.0, static_cast<double>(frames) - taken);
}

struct Covariances {
  Eigen::MatrixXd scattered, independent;
  double freedom = 1;
};

// (sum J'J)^-1 S (sum J'J)^-1 with S that of the frames' gradients and of their neighbours', and (sum J'J)^-1.
std::optional<Covariances> covariances(const Linearisation& at, const Eigen::VectorXd& weights,
                                       std::size_t alike_frames) {
  const Eigen::Index numbers = static_cast<Eigen::Index>(at.slopes.size()), frames = at.residuals.cols();
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(numbers, numbers), gradients(numbers, frames);
  const double scale = loss_scale(weights.size());
  for (Eigen::Index i = 0; i < frames; ++i) {
    const Eigen::MatrixXd jacobian = weights.asDiagonal() * at.jacobian(i);
    const Eigen::VectorXd residual = weights.cwiseProduct(at.residuals.col(i));
    const double trust = 1 / (1 + residual.squaredNorm() / (scale * scale));
    information += trust * product(jacobian.transpose(), jacobian);
    gradients.col(i) = trust * product(jacobian.transpose(), residual);
  }
  const Eigen::VectorXd priors = inverse_priors(at.unknowns, numbers).cwiseAbs2();
  information.diagonal() += priors;
  // In units of what each number alone would be known to: else metres and radians hide what is open.
  const Eigen::VectorXd units = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd normed = units.asDiagonal() * information * units.asDiagonal();
  if (!(eigenvalues_of_symmetric(normed)[0] > 1e-10)) return std::nullopt;
  Eigen::MatrixXd scatter = product(gradients, gradients.transpose());
  for (Eigen::Index lag = 1; lag < std::min(frames, static_cast<Eigen::Index>(alike_frames)); ++lag) {
    const double weight = 1 - static_cast<double>(lag) / static_cast<double>(alike_frames);
    const Eigen::MatrixXd shifted =
        product(gradients.rightCols(frames - lag), gradients.leftCols(frames - lag).transpose());
    scatter += weight * (shifted + shifted.transpose());
  }
  scatter.diagonal() += priors;
  const Eigen::MatrixXd inverse = units.asDiagonal() * inverse_of_symmetric(normed) * units.asDiagonal();
  const double freedom =
      freedom_of(frames, static_cast<double>(numbers) - priors.dot(inverse.diagonal()), alike_frames);
  return Covariances{freedom * product(product(inverse, scatter), inverse), inverse, freedom};
}

// By the numbers that are held.
Departures departures_at(const Linearisation& at, const Eigen::VectorXd& weights, std::size_t alike_frames,
                         double freedom, const Eigen::VectorXd& alike) {
  const Eigen::Index channels = at.residuals.rows(), frames = at.residuals.cols(), numbers = at.x.size(),
                     rows = channels * frames;
  const double scale = loss_scale(channels);
  LinearFit fit;
  fit.residuals = Eigen::VectorXd::Zero(rows + numbers);
  fit.alike_groups = alike_frames, fit.unmodelled_sigmas = unmodelled_sigmas;
  fit.freedom = freedom;
  Eigen::MatrixXd jacobian(rows + numbers, numbers), weighed(channels, frames);
  for (Eigen::Index i = 0; i < frames; ++i) {
    const Eigen::VectorXd residual = weights.cwiseProduct(at.residuals.col(i));
    weighed.col(i) = trust(residual.norm(), scale) * weights;
    fit.groups.push_back(channels * i);
    fit.residuals.segment(channels * i, channels) = weighed.col(i).cwiseProduct(at.residuals.col(i));
    jacobian.middleRows(channels * i, channels) = weighed.col(i).asDiagonal() * at.jacobian(i);
  }
  fit.groups.push_back(rows);
  if (alike.size() == channels) fit.alike = (alike.asDiagonal() * weighed).reshaped();
  const Eigen::VectorXd priors = inverse_priors(at.unknowns, numbers);
  jacobian.bottomRows(numbers) = priors.asDiagonal(), fit.residuals.tail(numbers) = priors.cwiseProduct(at.x);
  fit.jacobian = jacobian.sparseView();
  Eigen::MatrixXd slopes = Eigen::MatrixXd::Zero(rows + numbers, at.held.size());
  for (Eigen::Index k = 0; k < slopes.cols(); ++k)
    slopes.col(k).head(rows) = weighed.cwiseProduct(at.slope(numbers + k)).reshaped();
  return departures_of(fit, slopes);
}

}  // namespace

Block add_block(std::vector<Unknown>& unknowns, const std::vector<Unknown>& added) {
  const auto first = static_cast<Eigen::Index>(unknowns.size());
  unknowns.insert(unknowns.end(), added.begin(), added.end());
  return {first, static_cast<Eigen::Index>(added.size())};
}

std::optional<FrameFit> fit_frames(const FrameResiduals& residuals, const std::vector<Unknown>& unknowns,
                                   std::size_t alike_frames, const AtIteration& at_iteration, std::size_t held,
                                   const Eigen::VectorXd& alike) {
  Eigen::VectorXd starts(static_cast<Eigen::Index>(unknowns.size()));
  for (std::size_t i = 0; i < unknowns.size(); ++i) starts[static_cast<Eigen::Index>(i)] = unknowns[i].start;
  Linearisation at(residuals, unknowns, starts, held);
  if (!at.residuals.allFinite()) return std::nullopt;
  Eigen::VectorXd scales = robust_scales(at.residuals);
  for (int round = 0; round < 6; ++round) {
    const Eigen::VectorXd weights = scales.cwiseInverse();
    if (!solve(at, weights, at_iteration)) return std::nullopt;
    at.PrepareForEvaluation(true, true);
    const Eigen::VectorXd next = robust_scales(at.residuals);
    const bool settled = ((next - scales).cwiseAbs().array() < 0.01 * scales.array()).all();
    scales = next;
    if (settled) break;
  }
  const auto sigma = covariances(at, scales.cwiseInverse(), alike_frames);
  if (!sigma || !sigma->scattered.allFinite() || !sigma->independent.allFinite()) return std::nullopt;
  return FrameFit{
      at.x,         sigma->scattered, sigma->independent,
      at.residuals, scales,           departures_at(at, scales.cwiseInverse(), alike_frames, sigma->freedom, alike)};
}

}  // namespace lapservo::internal
