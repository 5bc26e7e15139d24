#include "lapservo/vision/search/agreement_search.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal::agreement_search_test {

using scenes::Sight;

// A marker of which blood hides a good third.
struct BloodyShot {
  Rig rig = scenes::usual_rig();
  JointVector q;
  Sight sight;

  explicit BloodyShot(std::uint64_t seed) : BloodyShot(scenes::BloodyMotion(scenes::usual_rig(), 0.5, seed, 1)) {}
  PoseUnknowns truth() const { return {scenes::pose_of(rig, 0, q), true}; }
  double length_m() const { return rig.instruments[0].marker.length_m(); }
  // A pose of any rotation, at another depth along the line of sight.
  PoseUnknowns start(double depth_scale) const {
    const Rigid3& camera_from_rcm = *rig.instruments[0].camera_from_rcm;
    const Eigen::Vector3d place = depth_scale * truth().pose().camera_from_unrolled.translation;
    return {pose_through_rcm(camera_from_rcm, configuration_through(camera_from_rcm, place).value()), true};
  }

 private:
  explicit BloodyShot(const scenes::BloodyMotion& seen) : q(seen.q[0]), sight(rig, seen.frames[0]) {}
};

PoseUnknowns result_of(const BloodyShot& shot, const PoseUnknowns& start) {
  AgreementSearch search(start, *shot.rig.instruments[0].camera_from_rcm, shot.length_m());
  WorkBudget whole(std::nullopt);
  EXPECT_TRUE(search.advance(shot.sight.scene(), whole));
  return search.result().value();
}

// Blood along a side makes a shaft look thin.
TEST(AgreementSearch, FindsABloodyMarkerThatSeemedFartherAway) {
  int found = 0, searches = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const BloodyShot shot(seed);
    for (const double depth_scale : {1.0, 1.3, 1.5}) {
      const PoseUnknowns result = result_of(shot, shot.start(depth_scale));
      const double away_m = result.pose().camera_from_unrolled.translation.norm();
      const double truly_away_m = shot.truth().pose().camera_from_unrolled.translation.norm();
      ++searches, found += std::abs(wrap_pi(result.pose().psi_rad - shot.q.psi_rad)) < 0.7 &&
                           std::abs(away_m / truly_away_m - 1) < 0.07;
    }
  }
  EXPECT_GE(found, searches - 3);
}

TEST(AgreementSearch, GoesOnFromWhereItsBudgetEnded) {
  const BloodyShot shot(2);
  const PoseUnknowns start = shot.start(1.2);
  const PoseUnknowns whole = result_of(shot, start);
  AgreementSearch search(start, *shot.rig.instruments[0].camera_from_rcm, shot.length_m());
  int frames = 1;
  for (WorkBudget part(2000.0); !search.advance(shot.sight.scene(), part); ++frames) part = WorkBudget(2000.0);
  EXPECT_GT(frames, 3);
  EXPECT_EQ(scenes::q_of(shot.rig, search.result().value()).vector(), scenes::q_of(shot.rig, whole).vector());
}

// The search's measure: the truth lies higher than what is beside it, however much blood there is.
TEST(ExplainedColours, AreMostAtTheTruth) {
  int higher = 0, asked = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const BloodyShot shot(seed);
    const double at_truth = explained_area_px2(shot.sight.scene(), shot.truth().pose(), true);
    const auto lies_lower = [&](const PoseUnknowns& other) {
      ++asked, higher += at_truth > explained_area_px2(shot.sight.scene(), other.pose(), true);
    };
    for (const double depth_scale : {0.7, 0.8, 1.2, 1.4}) lies_lower(shot.start(depth_scale).with_psi(shot.q.psi_rad));
    for (const double turn_rad : {-2.0, -1.0, 1.0, 2.0, pi})
      lies_lower(shot.truth().with_psi(shot.q.psi_rad + turn_rad));
    for (const double rho_m : {-5e-3, 5e-3}) lies_lower(shot.truth().changed_by(rho_m * PoseVector::Unit(4)));
  }
  EXPECT_EQ(higher, asked);
}

TEST(ExplainedColours, OfAnyRotationAreAtLeastThoseOfEach) {
  const BloodyShot shot(3);
  const Scene scene = shot.sight.scene();
  const double of_any = explained_area_px2(scene, shot.truth().pose(), false);
  for (int i = 0; i < 8; ++i) {
    const ShaftPose turned = shot.truth().with_psi(i * pi / 4).pose();
    EXPECT_EQ(explained_area_px2(scene, turned, false), of_any);
    EXPECT_LE(explained_area_px2(scene, turned, true), 1.02 * of_any);
  }
}

// A search keeps only what is better: anything else may be called nothing.
TEST(ExplainedColours, AreTheSameWhereOnlyMoreThanOthersAreAskedFor) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const BloodyShot shot(seed);
    const Scene scene = shot.sight.scene();
    for (const bool turned : {false, true})
      for (const double depth_scale : {0.7, 0.9, 1.0, 1.2}) {
        const ShaftPose pose = shot.start(depth_scale).with_psi(shot.q.psi_rad).pose();
        const double area_px2 = explained_area_px2(scene, pose, turned);
        for (const double less_px2 : {1e4, 100.0, 1e-3})
          EXPECT_EQ(explained_area_px2(scene, pose, turned, area_px2 - less_px2), area_px2);
        for (const double more_px2 : {1e-3, 100.0, 1e4})
          EXPECT_LE(explained_area_px2(scene, pose, turned, area_px2 + more_px2), area_px2);
      }
  }
}

TEST(WorkBudget, AllowsTheFirstStepOrAllBeyondWhatIsLeft) {
  WorkBudget budget(100.0);
  EXPECT_FALSE(budget.allows(101));
  budget.allow(WorkBudget::Beyond::first);
  EXPECT_TRUE(budget.allows(101));
  EXPECT_FALSE(budget.allows(101));
  budget.allow(WorkBudget::Beyond::first);
  EXPECT_TRUE(budget.allows(1));  // the first, whatever it takes
  EXPECT_FALSE(budget.allows(101));
  EXPECT_TRUE(budget.allows(100));
  budget.allow(WorkBudget::Beyond::all);
  budget.spend(200);
  EXPECT_TRUE(budget.allows(1));
  EXPECT_TRUE(budget.allows(1));
}

}  // namespace lapservo::internal::agreement_search_test
