#include "lapservo/vision/shaft/shaft_pose.h"

#include <string>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal {
namespace {

Eigen::Vector3d random_vector(Random& random) {
  return {random.normal(), random.normal(), random.normal()};
}

Rigid3 random_pose(Random& random) {
  const Eigen::Vector3d axis = random_vector(random).normalized();
  return {Eigen::Quaterniond(Eigen::AngleAxisd(random.uniform(-pi, pi), axis)), 0.1 * random_vector(random)};
}

PoseUnknowns random_unknowns(Random& random, bool rcm) {
  const Rigid3 pose = random_pose(random);
  if (!rcm) return PoseUnknowns::free({pose, random.uniform(-pi, pi)});
  return PoseUnknowns::rcm(
      pose, {random.uniform(-pi, pi), random.uniform(0.3, 2.8), random.uniform(0.05, 0.2), random.uniform(-pi, pi)});
}

TEST(PoseUnknowns, RowsAreTheDerivativeOfTheRetraction) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const PoseUnknowns unknowns = random_unknowns(random, seed % 2);
    const Eigen::Vector3d on_shaft = surface_point(0.004, random.uniform(-pi, pi), random.uniform(0, 0.03));
    const Eigen::Vector3d direction = random_vector(random);
    const auto projection = [&](const UnknownVector& step) {
      return direction.dot(unknowns.changed_by(step).pose().camera_from_unrolled * on_shaft);
    };
    const UnknownVector row = unknowns.row(unknowns.pose().camera_from_unrolled * on_shaft, direction);
    ASSERT_EQ(row.size(), unknowns.size());
    for (int i = 0; i < unknowns.size(); ++i) {
      constexpr double h = 1e-6;
      const UnknownVector step = h * UnknownVector::Unit(unknowns.size(), i);
      EXPECT_NEAR(row[i], (projection(step) - projection(-step)) / (2 * h), 1e-8) << "unknown " << i;
    }
    EXPECT_EQ(row[unknowns.size() - 1], 0);
  }
}

TEST(PoseUnknowns, NoChangeIsNoChangeAndPsiTurnsTheMarkerAlone) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const PoseUnknowns unknowns = random_unknowns(random, seed % 2);
    const int n = unknowns.size();
    const auto expect_same_shaft = [&](const PoseUnknowns& other) {
      const Rigid3 &a = unknowns.pose().camera_from_unrolled, &b = other.pose().camera_from_unrolled;
      EXPECT_LT(a.rotation.angularDistance(b.rotation), 1e-7);
      EXPECT_LT((a.translation - b.translation).norm(), 1e-15);
    };
    const PoseUnknowns same = unknowns.changed_by(UnknownVector::Zero(n));
    expect_same_shaft(same);
    EXPECT_EQ(same.pose().psi_rad, unknowns.pose().psi_rad);
    const PoseUnknowns turned = unknowns.changed_by(0.3 * UnknownVector::Unit(n, n - 1));
    expect_same_shaft(turned);
    EXPECT_NEAR(turned.pose().psi_rad, unknowns.pose().psi_rad + 0.3, 1e-12);
    const PoseUnknowns set = unknowns.with_psi(1.25);
    expect_same_shaft(set);
    EXPECT_EQ(set.pose().psi_rad, 1.25);
    EXPECT_EQ(set.size(), n);
  }
}

TEST(PoseUnknowns, ThroughTheRcmTheyAreQ) {
  Random random(31);
  const Rigid3 camera_from_rcm = random_pose(random);
  const JointVector q{0.4, 1.3, 0.12, -2};
  const PoseUnknowns unknowns = PoseUnknowns::rcm(camera_from_rcm, q);
  const Eigen::Vector4d step(0.01, -0.02, 0.003, 0.4);
  const PoseUnknowns moved = unknowns.changed_by(step);
  ASSERT_TRUE(moved.q());
  EXPECT_TRUE(moved.q()->vector().isApprox(q.vector() + step));
  const Rigid3 expected = camera_from_rcm * rcm_from_unrolled(*moved.q());
  EXPECT_TRUE(moved.pose().camera_from_unrolled.translation.isApprox(expected.translation));
  EXPECT_LT(moved.pose().camera_from_unrolled.rotation.angularDistance(expected.rotation), 1e-7);
  EXPECT_FALSE(PoseUnknowns::free(unknowns.pose()).q());
}

// tau of the centre line, which lies on that generatrix.
TEST(FacingTau, IsThatOfTheCentreLine) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const scenes::Shot& shot = scenes::usual_shot(seed);
    const auto tau_rad = facing_tau_rad(shot.rig.instruments[0].marker, scenes::pose_of(shot.rig, 0, shot.q));
    ASSERT_TRUE(tau_rad);
    EXPECT_NEAR(wrap_pi(*tau_rad - shot.line().tau_rad), 0, 1e-9) << "seed " << seed;
  }
}

}  // namespace
}  // namespace lapservo::internal
