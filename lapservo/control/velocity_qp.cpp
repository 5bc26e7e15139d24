#include "lapservo/control/velocity_qp.h"

#include <algorithm>

#include <Eigen/Cholesky>

namespace lapservo::internal {
namespace {

using UpTo4 = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 4, 1>;
using Gram = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 4, 4>;

using WorkingSet = InplaceVector<std::size_t, 4>;

/// mu of the minimiser y = N mu over the working set.
UpTo4 minimiser(const HalfSpaces& limits, const WorkingSet& working) {
  const auto size = static_cast<Eigen::Index>(working.size());
  Gram gram(size, size);
  UpTo4 bounds(size);
  for (std::size_t i = 0; i < working.size(); ++i) {
    bounds[i] = limits[working[i]].bound;
    for (std::size_t j = 0; j < working.size(); ++j)
      gram(i, j) = limits[working[i]].normal.dot(limits[working[j]].normal);
  }
  return gram.ldlt().solve(bounds);
}

}  // namespace

QpSolution solve_velocity_qp(const Eigen::Matrix4d& weight, const Eigen::Vector4d& wanted, const HalfSpaces& limits,
                             const Eigen::Vector4d& feasible_start) {
  constexpr int max_iterations = 80;
  const Eigen::LLT<Eigen::Matrix4d> cholesky(weight);
  // In y = L^T (x - wanted), normals scaled to unit length. A normal that vanishes stays zero and restricts nothing.
  HalfSpaces in_y;
  for (const HalfSpace& limit : limits) {
    const Eigen::Vector4d normal = cholesky.matrixL().solve(limit.normal);
    const double length = normal.norm();
    in_y.push_back(length > 0 ? HalfSpace{normal / length, (limit.bound - limit.normal.dot(wanted)) / length}
                              : HalfSpace{});
  }

  QpSolution solution;
  Eigen::Vector4d y = cholesky.matrixU() * (feasible_start - wanted);
  const double tolerance = 1e-12 * (1 + y.norm());
  WorkingSet working;
  // How far along `step` from y the first half-space lies; adds it to the working set when it is nearer than the end.
  const auto advance = [&](const Eigen::Vector4d& target) {
    const Eigen::Vector4d step = target - y;
    double fraction = 1;
    std::size_t blocking = in_y.size();
    for (std::size_t i = 0; i < in_y.size(); ++i) {
      const double outward = in_y[i].normal.dot(step);
      if (!(outward > tolerance) || std::find(working.begin(), working.end(), i) != working.end()) continue;
      const double room = std::max(0.0, in_y[i].bound - in_y[i].normal.dot(y));
      if (room < fraction * outward) {
        fraction = room / outward;
        blocking = i;
      }
    }
    y += fraction * step;
    if (blocking == in_y.size()) return true;
    working.push_back(blocking);
    return false;
  };

  for (int iteration = 0; iteration < max_iterations && !solution.optimal; ++iteration) {
    const UpTo4 mu = minimiser(in_y, working);
    Eigen::Vector4d target = Eigen::Vector4d::Zero();
    for (std::size_t k = 0; k < working.size(); ++k) target += mu[k] * in_y[working[k]].normal;
    // Four active half-spaces fix a point: y is it.
    if (working.size() < 4 && !advance(target)) continue;
    auto* released = working.end();
    for (auto* k = working.begin(); k != working.end(); ++k)
      if (mu[k - working.begin()] > tolerance && (released == working.end() || *k < *released)) released = k;
    solution.optimal = released == working.end();
    Eigen::Index most = 0;
    if (mu.size() > 0) mu.minCoeff(&most), solution.strongest = working[static_cast<std::size_t>(most)];
    if (!solution.optimal) std::copy(released + 1, working.end(), released), working.pop_back();
  }
  solution.constrained = !working.empty();
  solution.x = wanted + cholesky.matrixU().solve(y);
  if (solution.optimal && !solution.constrained) solution.x = wanted;
  return solution;
}

}  // namespace lapservo::internal
