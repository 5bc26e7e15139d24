#include "lapservo/control/velocity_qp.h"

#include <cmath>
#include <limits>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal {
namespace velocity_qp_test {

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
    p.limits.add(Eigen::Vector4d::Unit(i), p.start[i] + room());
    p.limits.add(-Eigen::Vector4d::Unit(i), -p.start[i] + room());
  }
  const auto more = static_cast<int>(random.uniform(0, 8.999));
  for (int i = 0; i < more; ++i) {
    const Eigen::Vector4d normal =
        random.uniform() < 0.1 ? Eigen::Vector4d::Unit(i % 4).eval() : (300 * random_vector(random)).eval();
    p.limits.add(normal, normal.dot(p.start) + 300 * room());
  }
  return p;
}

double cost(const Problem& p, const Eigen::Vector4d& x) {
  return (x - p.wanted).dot(p.weight * (x - p.wanted));
}

double worst_violation(const Problem& p, const Eigen::Vector4d& x) {
  double worst = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < p.limits.size; ++i) {
    const HalfSpace& side = p.limits.items[i];
    worst = std::max(worst, (side.normal.dot(x) - side.bound) / side.normal.norm());
  }
  return worst;
}

/// The least cost over the feasible minimisers of all sets of up to four sides taken as equalities.
double brute_force_cost(const Problem& p) {
  double least = std::numeric_limits<double>::infinity();
  if (worst_violation(p, p.wanted) < 1e-9) return 0;
  for (unsigned set = 1; set < (1U << p.limits.size); ++set) {
    const int n = __builtin_popcount(set);
    if (n > 4) continue;
    Eigen::MatrixXd normals(4, n);
    Eigen::VectorXd bounds(n);
    int k = 0;
    for (std::size_t i = 0; i < p.limits.size; ++i) {
      if ((set >> i & 1U) == 0) continue;
      normals.col(k) = p.limits.items[i].normal;
      bounds[k++] = p.limits.items[i].bound;
    }
    const Eigen::MatrixXd by_weight = p.weight.inverse() * normals;
    const Eigen::FullPivLU<Eigen::MatrixXd> gram(normals.transpose() * by_weight);
    if (n > 0 && !gram.isInvertible()) continue;
    Eigen::Vector4d x = p.wanted;
    if (n > 0) x -= by_weight * gram.solve(normals.transpose() * p.wanted - bounds);
    if (worst_violation(p, x) < 1e-7) least = std::min(least, cost(p, x));
  }
  return least;
}

TEST(VelocityQp, IsFeasibleAndAsGoodAsBruteForce) {
  int constrained = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const Problem p = random_problem(random);
    const QpSolution solution = solve_velocity_qp(p.weight, p.wanted, p.limits, p.start);
    ASSERT_TRUE(solution.optimal);
    EXPECT_LE(worst_violation(p, solution.x), 1e-8);
    const double least = brute_force_cost(p);
    EXPECT_NEAR(cost(p, solution.x), least, 1e-6 * (1 + least));
    constrained += solution.constrained ? 1 : 0;
  }
  EXPECT_GT(constrained, 40);
}

/// Stationarity, sign of the multipliers and complementary slackness over many more problems.
TEST(VelocityQp, NoFeasibleDirectionImprovesTheSolution) {
  int directions = 0;
  for (std::uint64_t seed = 1; seed <= 5000; ++seed) {
    Random random(seed);
    const Problem p = random_problem(random);
    const QpSolution solution = solve_velocity_qp(p.weight, p.wanted, p.limits, p.start);
    ASSERT_TRUE(solution.optimal) << "seed " << seed;
    ASSERT_LE(worst_violation(p, solution.x), 1e-8) << "seed " << seed;
    // The variational inequality of a convex problem: gradient . (z - x) >= 0 for every feasible z.
    const Eigen::Vector4d gradient = 2 * p.weight * (solution.x - p.wanted);
    for (int i = 0; i < 20; ++i) {
      Eigen::Vector4d z = p.start + random.uniform(0, 2) * random_vector(random);
      for (int halvings = 0; halvings < 30 && worst_violation(p, z) > 0; ++halvings) z = (z + p.start) / 2;
      if (worst_violation(p, z) > 0) continue;
      ASSERT_GE(gradient.dot(z - solution.x), -1e-6 * (1 + gradient.norm())) << "seed " << seed;
      ++directions;
    }
  }
  EXPECT_GT(directions, 20000);
}

TEST(VelocityQp, ReturnsTheWantedPointWhenItIsFeasible) {
  HalfSpaces limits;
  for (int i = 0; i < 4; ++i) {
    limits.add(Eigen::Vector4d::Unit(i), 1);
    limits.add(-Eigen::Vector4d::Unit(i), 1);
  }
  const Eigen::Vector4d wanted(0.1, -0.9, 0.3, 0.999);
  const auto solution = solve_velocity_qp(Eigen::Matrix4d::Identity(), wanted, limits, Eigen::Vector4d::Zero());
  EXPECT_EQ(solution.x, wanted);
  EXPECT_FALSE(solution.constrained);
}

}  // namespace velocity_qp_test
}  // namespace lapservo::internal
