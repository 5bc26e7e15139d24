#include "lapservo/control/velocity_qp.h"

#include <algorithm>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace lapservo::internal {
namespace {

using UpTo4 = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 4, 1>;
using Gram = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 4, 4>;

struct WorkingSet {
  std::array<std::size_t, 4> index{};
  int size = 0;

  bool contains(std::size_t i) const {
    for (int k = 0; k < size; ++k) {
      if (index[static_cast<std::size_t>(k)] == i) return true;
    }
    return false;
  }
  void add(std::size_t i) { index[static_cast<std::size_t>(size++)] = i; }
  void remove(int k) {
    for (int j = k; j + 1 < size; ++j) index[static_cast<std::size_t>(j)] = index[static_cast<std::size_t>(j + 1)];
    --size;
  }
  std::size_t operator[](int k) const { return index[static_cast<std::size_t>(k)]; }
};

/// mu of the minimiser y = N mu over the working set.
UpTo4 minimiser(const HalfSpaces& limits, const WorkingSet& working) {
  Gram gram(working.size, working.size);
  UpTo4 bounds(working.size);
  for (int i = 0; i < working.size; ++i) {
    bounds[i] = limits.items[working[i]].bound;
    for (int j = 0; j < working.size; ++j) {
      gram(i, j) = limits.items[working[i]].normal.dot(limits.items[working[j]].normal);
    }
  }
  return gram.ldlt().solve(bounds);
}

}  // namespace

QpSolution solve_velocity_qp(const Eigen::Matrix4d& weight, const Eigen::Vector4d& wanted, const HalfSpaces& limits,
                             const Eigen::Vector4d& feasible_start) {
  constexpr int max_iterations = 80;
  const Eigen::LLT<Eigen::Matrix4d> cholesky(weight);
  // In y = L^T (x - wanted), normals scaled to unit length. A normal that vanishes restricts nothing.
  HalfSpaces in_y;
  for (std::size_t i = 0; i < limits.size; ++i) {
    const Eigen::Vector4d normal = cholesky.matrixL().solve(limits.items[i].normal);
    const double length = normal.norm();
    if (!(length > 0)) continue;
    in_y.add(normal / length, (limits.items[i].bound - limits.items[i].normal.dot(wanted)) / length);
  }

  QpSolution solution;
  Eigen::Vector4d y = cholesky.matrixU() * (feasible_start - wanted);
  const double tolerance = 1e-12 * (1 + y.norm());
  WorkingSet working;
  // How far along `step` from y the first half-space lies; adds it to the working set when it is nearer than the end.
  const auto advance = [&](const Eigen::Vector4d& target) {
    const Eigen::Vector4d step = target - y;
    double fraction = 1;
    std::size_t blocking = in_y.size;
    for (std::size_t i = 0; i < in_y.size; ++i) {
      const double outward = in_y.items[i].normal.dot(step);
      if (!(outward > tolerance) || working.contains(i)) continue;
      const double room = std::max(0.0, in_y.items[i].bound - in_y.items[i].normal.dot(y));
      if (room < fraction * outward) {
        fraction = room / outward;
        blocking = i;
      }
    }
    y += fraction * step;
    if (blocking == in_y.size) return true;
    working.add(blocking);
    return false;
  };

  for (int iteration = 0; iteration < max_iterations && !solution.optimal; ++iteration) {
    const UpTo4 mu = minimiser(in_y, working);
    Eigen::Vector4d target = Eigen::Vector4d::Zero();
    for (int k = 0; k < working.size; ++k) target += mu[k] * in_y.items[working[k]].normal;
    // Four active half-spaces fix a point: y is it.
    if (working.size < 4 && !advance(target)) continue;
    int released = -1;
    for (int k = 0; k < working.size; ++k) {
      if (mu[k] > tolerance && (released < 0 || working[k] < working[released])) released = k;
    }
    if (released < 0) {
      solution.optimal = true;
    } else {
      working.remove(released);
    }
  }
  solution.constrained = working.size > 0;
  solution.x = wanted + cholesky.matrixU().solve(y);
  if (solution.optimal && !solution.constrained) solution.x = wanted;
  return solution;
}

}  // namespace lapservo::internal
