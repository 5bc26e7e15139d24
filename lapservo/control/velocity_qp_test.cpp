#include "lapservo/control/velocity_qp.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/QR>
#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::velocity_qp_test {

struct Problem {
  Eigen::Matrix4d weight = Eigen::Matrix4d::Identity();
  Eigen::Vector4d wanted = Eigen::Vector4d::Zero();
  Eigen::Vector4d start = Eigen::Vector4d::Zero();
  HalfSpaces limits;
};

Eigen::Vector4d random_vector(Random& random) {
  return {random.normal(), random.normal(), random.normal(), random.normal()};
}

/// A box and slabs that hold the start, at times on their boundary, at times with parallel or repeated sides.
Problem random_problem(Random& random) {
  Problem p;
  Eigen::Matrix4d root;
  for (int i = 0; i < 4; ++i) root.col(i) = std::pow(10, random.uniform(-1.5, 1.5)) * random_vector(random);
  p.weight = root * root.transpose() + 1e-3 * Eigen::Matrix4d::Identity();
  p.wanted = random.uniform(0.1, 5) * random_vector(random);
  p.start = 0.3 * random_vector(random);
  const auto room = [&] { return random.uniform() < 0.2 ? 0.0 : random.uniform(0, 1); };
  for (int i = 0; i < 4; ++i) {
    p.limits.push_back({Eigen::Vector4d::Unit(i), p.start[i] + room()});
    p.limits.push_back({-Eigen::Vector4d::Unit(i), -p.start[i] + room()});
  }
  const auto more = static_cast<int>(random.uniform(0, 8.999));
  for (int i = 0; i < more; ++i) {
    const Eigen::Vector4d normal =
        random.uniform() < 0.1 ? Eigen::Vector4d::Unit(i % 4).eval() : (300 * random_vector(random)).eval();
    p.limits.push_back({normal, normal.dot(p.start) + 300 * room()});
  }
  return p;
}

double worst_violation(const Problem& p, const Eigen::Vector4d& x) {
  double worst = -std::numeric_limits<double>::infinity();
  for (const HalfSpace& side : p.limits) {
    worst = std::max(worst, (side.normal.dot(x) - side.bound) / side.normal.norm());
  }
  return worst;
}

/// The distance of the downhill direction from x to the nearest combination of the normals of up to four sides that x
/// touches, none of them negative: 0 proves that x is the optimum (Karush, Kuhn and Tucker).
double distance_to_optimality(const Problem& p, const Eigen::Vector4d& x) {
  const Eigen::Vector4d downhill = p.weight * (p.wanted - x);
  std::vector<Eigen::Vector4d> touched;
  for (const HalfSpace& side : p.limits) {
    if (side.bound - side.normal.dot(x) < 1e-8 * side.normal.norm()) touched.push_back(side.normal.normalized());
  }
  double least = downhill.norm();
  for (unsigned set = 1; set < (1U << touched.size()); ++set) {
    Eigen::MatrixXd normals(4, 0);
    for (std::size_t i = 0; i < touched.size(); ++i) {
      if ((set >> i & 1U) == 0) continue;
      normals.conservativeResize(4, normals.cols() + 1);
      normals.rightCols<1>() = touched[i];
    }
    if (normals.cols() > 4) continue;
    const Eigen::VectorXd multipliers = normals.colPivHouseholderQr().solve(downhill);
    if (multipliers.minCoeff() > -1e-6 * (1 + downhill.norm()))
      least = std::min(least, (normals * multipliers - downhill).norm());
  }
  return least;
}

TEST(VelocityQp, IsFeasibleAndOptimal) {
  int constrained = 0;
  for (std::uint64_t seed = 1; seed <= 5000; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const Problem p = random_problem(random);
    const QpSolution solution = solve_velocity_qp(p.weight, p.wanted, p.limits, p.start);
    ASSERT_TRUE(solution.optimal);
    ASSERT_LE(worst_violation(p, solution.x), 1e-8);
    ASSERT_LE(distance_to_optimality(p, solution.x), 1e-6 * (1 + (p.weight * (p.wanted - solution.x)).norm()));
    constrained += solution.constrained ? 1 : 0;
    const HalfSpace& side = p.limits[solution.strongest];
    ASSERT_TRUE(!solution.constrained || side.bound - side.normal.dot(solution.x) < 1e-8 * side.normal.norm());
  }
  EXPECT_GT(constrained, 3000);
}

}  // namespace lapservo::internal::velocity_qp_test
