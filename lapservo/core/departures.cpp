#include "lapservo/core/departures.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/SparseCholesky>

#include "lapservo/core/dense_matrix.h"

namespace lapservo::internal {
namespace {

constexpr double seen_sigmas = 3;
// The part of the squares of a fault's slopes that x has to leave, for it to be distinguished.
constexpr double least_left = 1e-9;

// Standard deviation of a sum over groups that stay alike over some neighbouring ones (Newey and West 1987).
double sigma_of_sum(const Eigen::VectorXd& of_groups, std::size_t alike) {
  double variance = of_groups.squaredNorm();
  for (Eigen::Index lag = 1; lag < std::min(of_groups.size(), static_cast<Eigen::Index>(alike)); ++lag)
    variance += 2 * (1 - static_cast<double>(lag) / static_cast<double>(alike)) *
                of_groups.tail(of_groups.size() - lag).dot(of_groups.head(of_groups.size() - lag));
  return std::sqrt(std::max(variance, 0.0));
}

struct Estimate {
  double size = 0, sigma = 1, clear_sigma = 1;
  double sigmas() const { return std::abs(size) / sigma; }
  bool is_clear() const { return std::abs(size) > seen_sigmas * clear_sigma; }
};

// Standard deviation of a fault's size by all that may put it off: the scatter of the groups, errors that are alike,
// priors. `sigma`: by the scatter alone.
double clear_sigma(const LinearFit& fit, const Eigen::VectorXd& left, double sigma) {
  const Eigen::Index first = fit.groups.front(), rows = fit.groups.back() - first;
  double variance = left.head(first).squaredNorm() + left.tail(left.size() - first - rows).squaredNorm();
  if (fit.alike.size() == rows) {
    // As large as errors of this size may be together where they go as the fault does.
    const Eigen::VectorXd moved = fit.alike.cwiseSign().cwiseAbs().cwiseProduct(left.segment(first, rows));
    variance += fit.alike.squaredNorm() * moved.squaredNorm();
  }
  return std::hypot(std::sqrt(fit.freedom) * sigma, std::sqrt(variance) / left.squaredNorm());
}

// One fault by the slopes that x leaves of it; 0 with a sigma of 1 where it can't be distinguished from x.
Estimate estimate(const LinearFit& fit, const Eigen::VectorXd& residuals, const Eigen::VectorXd& left,
                  double slopes_squared) {
  const double squares = left.squaredNorm();
  if (!(squares > least_left * slopes_squared)) return {};
  const double size = -left.dot(residuals) / squares;
  if (fit.noise > 0) {
    const double sigma = fit.unmodelled_sigmas * fit.noise / std::sqrt(squares);
    return {size, sigma, sigma};
  }
  Eigen::VectorXd gradients(static_cast<Eigen::Index>(fit.groups.size()) - 1);
  for (Eigen::Index g = 0; g < gradients.size(); ++g) {
    const Eigen::Index first = fit.groups[static_cast<std::size_t>(g)],
                       rows = fit.groups[static_cast<std::size_t>(g) + 1] - first;
    const auto part = left.segment(first, rows);
    gradients[g] = part.dot(residuals.segment(first, rows) + size * part);
  }
  const double sigma = std::max(1e-300, fit.unmodelled_sigmas * sigma_of_sum(gradients, fit.alike_groups) / squares);
  return {size, sigma, clear_sigma(fit, left, sigma)};
}

// The part of the slopes of faults that x leaves, and the displacement of x by a size of 1 of each.
struct BesideX {
  Eigen::MatrixXd left, displacements;

  BesideX(const Eigen::SparseMatrix<double>& jacobian, const Eigen::MatrixXd& slopes) {
    Eigen::VectorXd units(jacobian.cols());  // metres and radians
    for (Eigen::Index i = 0; i < units.size(); ++i) units[i] = 1 / std::max(1e-300, jacobian.col(i).norm());
    const Eigen::SparseMatrix<double> normed = jacobian * units.asDiagonal();
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> information(normed.transpose() * normed);
    const Eigen::MatrixXd by_x = information.solve(normed.transpose() * slopes);
    displacements = units.asDiagonal() * by_x;
    left = slopes - normed * by_x;
  }

  // From now on one of them is fitted, too.
  void add_to_x(Eigen::Index one) {
    const double squares = left.col(one).squaredNorm();
    for (Eigen::Index k = 0; k < left.cols(); ++k) {
      if (k == one) continue;
      const double part = left.col(one).dot(left.col(k)) / squares;
      left.col(k) -= part * left.col(one), displacements.col(k) -= part * displacements.col(one);
    }
  }
};

}  // namespace

Departures departures_of(const LinearFit& fit, const Eigen::MatrixXd& slopes) {
  BesideX beside(fit.jacobian, slopes);
  const auto count = static_cast<std::size_t>(slopes.cols());
  Eigen::VectorXd residuals = fit.residuals, bias = Eigen::VectorXd::Zero(fit.jacobian.cols());
  const auto estimates_beside = [&] {
    std::vector<Estimate> estimates;
    for (Eigen::Index k = 0; k < slopes.cols(); ++k)
      estimates.push_back(estimate(fit, residuals, beside.left.col(k), slopes.col(k).squaredNorm()));
    return estimates;
  };
  const std::vector<Estimate> alone = estimates_beside();
  std::vector<Estimate> estimates = alone;
  std::vector<bool> is_seen(count);
  Departures result;
  while (result.seen.size() < fit.most_seen) {
    std::optional<std::size_t> clearest;
    for (std::size_t k = 0; k < count; ++k)
      if (!is_seen[k] && estimates[k].sigmas() > (clearest ? estimates[*clearest].sigmas() : seen_sigmas)) clearest = k;
    if (!clearest) break;
    const auto column = static_cast<Eigen::Index>(*clearest);
    const Estimate& one = estimates[*clearest];
    const double size = one.size;
    is_seen[*clearest] = true, result.seen.push_back({*clearest, size, one.sigma, one.is_clear()});
    bias += size * beside.displacements.col(column), residuals += size * beside.left.col(column);
    beside.add_to_x(column);
    estimates = estimates_beside();
  }
  result.by_seen = product(bias, bias.transpose());
  result.by_instead = Eigen::MatrixXd::Zero(bias.size(), bias.size());
  for (std::size_t k = 0; k < count; ++k) {
    const bool instead = !is_seen[k] && alone[k].sigmas() > seen_sigmas;
    if (!is_seen[k] && !instead) continue;
    const Eigen::VectorXd displacement = beside.displacements.col(static_cast<Eigen::Index>(k));
    const Eigen::MatrixXd squares = product(displacement, displacement.transpose());
    const double variance = std::pow(estimates[k].sigma, 2);
    if (is_seen[k]) result.by_seen += variance * squares;
    if (!instead) continue;
    // As large as it would be, as far as the residuals allow that beside those that are seen.
    result.instead.push_back({k, alone[k].size, alone[k].sigma, alone[k].is_clear()});
    const double prior = std::pow(alone[k].size, 2), known = prior / (prior + variance);
    result.by_instead += (known * variance + std::pow(known * estimates[k].size, 2)) * squares;
  }
  return result;
}

}  // namespace lapservo::internal
