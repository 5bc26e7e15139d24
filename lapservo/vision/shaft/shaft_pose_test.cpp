#include "lapservo/vision/shaft/shaft_pose.h"

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/testing/seeded_random.h"
#include "lapservo/testing/shots.h"

namespace lapservo::internal::shaft_pose_test {

PoseUnknowns random_unknowns(Random& random) {
  const Eigen::Vector3d axis = scenes::normal_vector(random).normalized();
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(random.uniform(-pi, pi), axis));
  const Eigen::Vector3d translation = 0.1 * scenes::normal_vector(random);
  return {{{rotation, translation}, random.uniform(-pi, pi)}, false};
}

TEST(PoseUnknowns, RowsAreTheDerivativeOfTheRetraction) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    testing::SeededRandom random(seed);
    const PoseUnknowns unknowns = random_unknowns(random);
    const Eigen::Vector3d on_shaft = surface_point(0.004, random.uniform(-pi, pi), random.uniform(0, 0.03));
    const Eigen::Vector3d direction = scenes::normal_vector(random);
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

TEST(PoseUnknowns, TheChangeToAnotherPoseLeadsThere) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    testing::SeededRandom random(seed);
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

}  // namespace lapservo::internal::shaft_pose_test
