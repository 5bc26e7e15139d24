#include "lapservo/vision/shaft/shaft_pose.h"

#include <string>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/testing/shots.h"

namespace lapservo::internal {
namespace {

Eigen::Vector3d random_vector(Random& random) {
  return {random.normal(), random.normal(), random.normal()};
}

PoseUnknowns random_unknowns(Random& random) {
  const Eigen::Vector3d axis = random_vector(random).normalized();
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(random.uniform(-pi, pi), axis));
  const Eigen::Vector3d translation = 0.1 * random_vector(random);
  return {{{rotation, translation}, random.uniform(-pi, pi)}, false};
}

TEST(PoseUnknowns, RowsAreTheDerivativeOfTheRetraction) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const PoseUnknowns unknowns = random_unknowns(random);
    const Eigen::Vector3d on_shaft = surface_point(0.004, random.uniform(-pi, pi), random.uniform(0, 0.03));
    const Eigen::Vector3d direction = random_vector(random);
    const auto projection = [&](const PoseVector& step) {
      return direction.dot(unknowns.changed_by(step).pose().camera_from_unrolled * on_shaft);
    };
    const UnknownVector row = unknowns.row(unknowns.pose().camera_from_unrolled * on_shaft, direction);
    for (int i = 0; i < pose_unknowns; ++i) {
      constexpr double h = 1e-6;
      const PoseVector step = h * PoseVector::Unit(i);
      EXPECT_NEAR(row[i], (projection(step) - projection(-step)) / (2 * h), 1e-8) << "unknown " << i;
    }
    EXPECT_EQ(row[psi_unknown], 0);
    EXPECT_EQ(row[film_unknown], 0);
  }
}

TEST(PoseUnknowns, NoChangeIsNoChangeAndPsiTurnsTheMarkerAlone) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const PoseUnknowns unknowns = random_unknowns(random);
    const auto expect_same_shaft = [&](const PoseUnknowns& other) {
      const Rigid3 &a = unknowns.pose().camera_from_unrolled, &b = other.pose().camera_from_unrolled;
      EXPECT_LT(a.rotation.angularDistance(b.rotation), 1e-7);
      EXPECT_LT((a.translation - b.translation).norm(), 1e-15);
    };
    for (const double turn_rad : {0.0, 0.3}) {
      const PoseUnknowns turned = unknowns.changed_by(turn_rad * PoseVector::Unit(psi_unknown));
      expect_same_shaft(turned);
      EXPECT_NEAR(turned.pose().psi_rad, unknowns.pose().psi_rad + turn_rad, 1e-12);
    }
    expect_same_shaft(unknowns.with_psi(1.25));
    EXPECT_EQ(unknowns.with_psi(1.25).pose().psi_rad, 1.25);
  }
}

TEST(PoseUnknowns, TheChangeToAnotherPoseLeadsThere) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const PoseUnknowns unknowns = random_unknowns(random);
    PoseVector step;
    for (double& number : step) number = 1e-3 * random.normal();
    EXPECT_LT((unknowns.change_to(unknowns.changed_by(step)) - step).norm(), 1e-5);
  }
}

// tau of the centre line, which lies on that generatrix.
TEST(FacingTau, IsThatOfTheCentreLine) {
  scenes::for_each_shot(8, [](const scenes::Shot& shot) {
    const auto tau_rad = facing_tau_rad(shot.rig.instruments[0].marker, scenes::pose_of(shot.rig, 0, shot.q));
    ASSERT_TRUE(tau_rad);
    EXPECT_NEAR(wrap_pi(*tau_rad - shot.line().tau_rad), 0, 1e-9);
  });
}

}  // namespace
}  // namespace lapservo::internal
