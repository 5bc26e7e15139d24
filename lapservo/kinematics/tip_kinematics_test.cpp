#include "lapservo/kinematics/tip_kinematics.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/test_models.h"
#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal::tip_kinematics_test {

// Straight, and bent: up to 8 mm beside the axis.
Rigid3 random_tip(Random& random) {
  const bool straight = random.uniform(0, 1) < 0.3;
  const auto beside_m = [&] { return straight ? 0 : random.uniform(-0.008, 0.008); };
  const auto turn_rad = [&] { return straight ? 0 : random.uniform(-1, 1); };
  return {rotation_by({turn_rad(), turn_rad(), turn_rad()}), {beside_m(), beside_m(), random.uniform(0.03, 0.09)}};
}

template <typename Law>
void for_random_tips(std::uint64_t seed, const Law& law) {
  testing::SeededRandom random(seed);
  for (const ImageModel& model : testing::image_models())
    for (int trial = 0; trial < 100; ++trial) {
      const JointVector q = testing::visible_configuration(model, random);
      if (std::sin(q.phi_rad) < 0.3) continue;
      SCOPED_TRACE("trial " + std::to_string(trial));
      const Rigid3 marker_from_tip = random_tip(random);
      law(model, q, marker_from_tip, camera_from_marker(model.marker, model.camera_from_rcm, q) * marker_from_tip);
    }
}

TEST(TipKinematics, TheConfigurationOfATipIsItsOwn) {
  for_random_tips(71, [](const ImageModel& model, const JointVector& q, const Rigid3& tip, const Rigid3& seen) {
    const auto found =
        configuration_of_tip(model.camera_from_rcm, model.marker, tip.translation, seen.translation, q.psi_rad);
    ASSERT_TRUE(found);
    EXPECT_LT((found->vector() - q.vector()).norm(), 1e-9);
  });
}

TEST(TipKinematics, AnOrientationGivesThePsiThatComesNearestToIt) {
  Random random(74);
  for_random_tips(75, [&](const ImageModel& model, const JointVector& q, const Rigid3& tip, const Rigid3& seen) {
    const auto towards = [&](const Eigen::Quaterniond& rotation) {
      return configuration_of_tip(model.camera_from_rcm, model.marker, tip, seen.translation, rotation).value();
    };
    EXPECT_LT(std::abs(wrap_pi(towards(seen.rotation).psi_rad - q.psi_rad)), 1e-8);
    // Another one, which psi alone cannot reach.
    const Eigen::Quaterniond wanted =
        seen.rotation * rotation_by(0.3 * Eigen::Vector3d(random.normal(), random.normal(), random.normal()));
    const JointVector best = towards(wanted);
    const auto off_rad = [&](double psi_rad) {
      JointVector turned = best;
      turned.psi_rad = psi_rad;
      return wanted.angularDistance((camera_from_marker(model.marker, model.camera_from_rcm, turned) * tip).rotation);
    };
    for (const double by_rad : {-0.01, 0.01}) EXPECT_GT(off_rad(best.psi_rad + by_rad), off_rad(best.psi_rad));
  });
}

TEST(TipKinematics, NothingReachesBehindTheRcmOrPlacesThatAreNone) {
  const ImageModel model = testing::image_models().front();
  const Eigen::Vector3d tip(0.002, 0.001, 0.05);
  const auto at = [&](const Eigen::Vector3d& in_rcm, double psi_rad = 0) {
    return configuration_of_tip(model.camera_from_rcm, model.marker, tip, model.camera_from_rcm * in_rcm, psi_rad);
  };
  EXPECT_TRUE(at({0.12, 0, 0}));
  EXPECT_FALSE(at({0.04, 0, 0}));   // the marker would lie behind the RCM
  EXPECT_FALSE(at({0.001, 0, 0}));  // nearer than the tip is to the axis
  EXPECT_FALSE(at({NAN, 0, 0}));
  EXPECT_FALSE(at({0.12, 0, 0}, NAN));
  EXPECT_FALSE(at({INFINITY, 0, 0}));
}

}  // namespace lapservo::internal::tip_kinematics_test
