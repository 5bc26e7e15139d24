#pragma once

#include <cstddef>

#include <Eigen/Core>

#include "lapservo/core/inplace_vector.h"

namespace lapservo::internal {

/// normal . x <= bound
struct HalfSpace {
  Eigen::Vector4d normal = Eigen::Vector4d::Zero();
  double bound = 0;
};

/// Two a joint and two for each of four image coordinates.
using HalfSpaces = InplaceVector<HalfSpace, 16>;

struct QpSolution {
  Eigen::Vector4d x = Eigen::Vector4d::Zero();
  bool optimal = false;      ///< else feasible, but the iteration limit was reached
  bool constrained = false;  ///< at least one half-space holds x back
  /// Place in `limits` of the half-space with the largest multiplier, where x is optimal and constrained.
  std::size_t strongest = 0;
};

/// Minimises (x - wanted)^T weight (x - wanted) subject to `limits`, from a feasible start; `weight` is symmetric and
/// positive definite.
///
/// Primal active-set method. With weight = L L^T and y = L^T (x - wanted) the cost is |y|^2 and every constraint stays
/// a half-space, so the minimiser over a working set of equalities N^T y = b is y = N mu with (N^T N) mu = b, and it is
/// the optimum when all mu <= 0 (the multipliers are -mu). Every iterate is a point on the segment from a feasible
/// point to such a minimiser, cut at the first half-space it would leave: feasible whatever happens, so the answer
/// obeys the limits even if the iteration limit is reached. A half-space that stops a step is linearly independent of
/// the working set, since the step lies in the null space of the latter. Ties go to the lowest index (Bland's rule).
QpSolution solve_velocity_qp(const Eigen::Matrix4d& weight, const Eigen::Vector4d& wanted, const HalfSpaces& limits,
                             const Eigen::Vector4d& feasible_start);

}  // namespace lapservo::internal
