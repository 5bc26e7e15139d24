#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCore>

namespace lapservo::internal {

/// Weight of a residual, as large as this, under Cauchy's loss of this scale; its square is the loss's derivative.
inline double trust(double residual, double loss_scale) {
  return 1 / std::hypot(1.0, residual / loss_scale);
}

/// A fit of numbers x by least squares at its solution; residuals and slopes in units of the noise.
struct LinearFit {
  Eigen::SparseMatrix<double> jacobian;  ///< a row a residual (a prior is one, too), a column a number of x
  Eigen::VectorXd residuals;
  std::vector<Eigen::Index> groups;  ///< the first row of each group of residuals, as those of a frame; last, their end
  std::size_t alike_groups = 1;      ///< over so many neighbouring groups noise stays alike
  double noise = 0;                  ///< sigma of residuals that are independent; 0: by the scatter of the groups
  double unmodelled_sigmas = 1;      ///< how many times as far off as the residuals' scatter makes it a number may be
  double freedom = 1;                ///< times the scatter's variance: what a fit to few groups takes away from it
  /// Of each residual in the groups: how far it may be off alike wherever a fault moves it, so that it does not average
  /// out. Empty: not at all.
  Eigen::VectorXd alike{};
  std::size_t most_seen = 4;
};

/// A number that the model takes for 0, as the residuals have it.
struct Fault {
  std::size_t which;
  double size, sigma;
  /// Beyond chance also with `freedom`, `alike` and the residuals outside of the groups, which are priors with a sigma
  /// of 1. A fault that is seen without that may be there: sigmas count it, but it is no cause to name.
  bool is_clear = true;
};

/// How far data depart from a model.
struct Departures {
  std::vector<Fault> seen;     ///< beyond chance, the clearest first: each fitted beside x and those before it
  std::vector<Fault> instead;  ///< that would be seen without those: each fitted beside x alone
  /// Mean squares and products of what x is off by, which was fitted without them.
  Eigen::MatrixXd by_seen, by_instead;
};

/// The faults that are seen, with their size; `possible` has one for each column of the slopes.
template <typename Described>
std::vector<Described> seen_of(const Departures& departures, const std::vector<Described>& possible) {
  std::vector<Described> seen;
  for (const Fault& fault : departures.seen) {
    seen.push_back(possible[fault.which]);
    seen.back().size = fault.size;
  }
  return seen;
}

/// To first order. `slopes`: of the residuals, a column a fault.
Departures departures_of(const LinearFit& fit, const Eigen::MatrixXd& slopes);

}  // namespace lapservo::internal
