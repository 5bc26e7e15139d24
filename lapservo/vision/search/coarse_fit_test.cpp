#include "lapservo/vision/search/coarse_fit.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/testing/scenes.h"
#include "lapservo/vision/search/starts.h"

namespace lapservo::internal {
namespace {

using scenes::Shot;
using scenes::Sight;
using scenes::usual_shot;

// Farthest that a boundary on the centre line lies from its true place.
double miss_px(const Shot& shot, const ShaftPose& pose) {
  const auto seen =
      centre_line(shot.rig.camera, shot.rig.instruments[0].marker, pose.camera_from_unrolled, pose.psi_rad);
  double farthest = seen ? 0 : 1e9;
  for (std::size_t k = 0; seen && k < 4; ++k)
    farthest = std::max(farthest, (seen->ideal_px[k] - shot.line().ideal_px[k]).norm());
  return farthest;
}

// Some tens of pixels.
PoseVector large_offset(Random& random) {
  const auto within = [&](double reach) { return random.uniform(-reach, reach); };
  PoseVector offset;
  offset << within(0.06), within(0.06), within(1e-3), within(1e-3), within(2.5e-3), within(pi);
  return offset;
}

TEST(CoarseFit, AlignsAPoseToAboutAPixelWhateverItsRotation) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed)
    for (const bool rcm : {true, false}) {
      SCOPED_TRACE("seed " + std::to_string(seed) + (rcm ? " through the RCM" : " free"));
      const Shot& shot = usual_shot(seed);
      Random random(seed + 50);
      const PoseUnknowns truth = shot.truth(rcm);
      const CoarseFit fit = fit_coarsely(shot.sight.scene(), truth.changed_by(large_offset(random)), Rotation::unknown);
      ASSERT_TRUE(fit.found);
      EXPECT_LT(miss_px(shot, fit.unknowns.pose()), 2.5);
      EXPECT_LT(std::abs(wrap_pi(fit.unknowns.pose().psi_rad - shot.q.psi_rad)), 0.1);
      EXPECT_GT(fit.rotation_score, 0.85);
      EXPECT_LT(fit.rival_score, 0.9 * fit.rotation_score);
    }
}

TEST(CoarseFit, KeepsAGivenRotationWhenNotAskedToSearch) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Shot& shot = usual_shot(seed);
    PoseVector offset;
    offset << 0.004, -0.003, 3e-4, 3e-4, 1e-3, 0.05;
    const CoarseFit fit = fit_coarsely(shot.sight.scene(), shot.truth(true).changed_by(offset), Rotation::known);
    ASSERT_TRUE(fit.found);
    EXPECT_LT(miss_px(shot, fit.unknowns.pose()), 3);
    EXPECT_EQ(fit.rotation_score, 0);
  }
}

TEST(CoarseFit, FindsNothingInTissueNorFarFromTheMarker) {
  const Shot& shot = usual_shot(2);
  const Sight empty(shot.rig, scenes::render_nothing(shot.rig, 3));
  EXPECT_FALSE(fit_coarsely(empty.scene(), shot.truth(true), Rotation::unknown).found);
  PoseVector offset = PoseVector::Zero();
  offset[1] = 1.5;
  EXPECT_FALSE(fit_coarsely(shot.sight.scene(), shot.truth(false).changed_by(offset), Rotation::unknown).found);
}

// Another instrument's bands leave some of the boundaries, but no rotation explains the colours.
TEST(CoarseFit, AnotherOrderOfTheColoursAgreesWithNoRotation) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const Shot& shot = usual_shot(seed);
    Rig other = shot.rig;
    other.instruments[0].marker.hues_deg = {180, 270, 90};
    const Sight sight(other, shot.bgr);
    const CoarseFit fit = fit_coarsely(sight.scene(), shot.truth(true), Rotation::unknown);
    EXPECT_TRUE(!fit.found || fit.rotation_score < 0.3) << "seed " << seed;
  }
}

TEST(InitialPoses, LieNearTheTruth) {
  for (const bool rcm : {true, false})
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
      SCOPED_TRACE("seed " + std::to_string(seed) + (rcm ? " through the RCM" : " free"));
      const Shot& shot = usual_shot(seed);
      const auto blobs = find_blobs(shot.sight.view(), shot.sight.classes(), 8, 8);
      ASSERT_FALSE(blobs.empty());
      const auto poses = starts_in(shot.sight.scene(), blobs[0],
                                   rcm ? shot.rig.instruments[0].camera_from_rcm : std::optional<Rigid3>())
                             .poses;
      ASSERT_FALSE(poses.empty());
      double nearest_px = 1e9;
      for (const PoseUnknowns& unknowns : poses) {
        ShaftPose pose = unknowns.pose();  // the rotation is still unknown: only the ends count
        const auto line =
            centre_line(shot.rig.camera, shot.rig.instruments[0].marker, pose.camera_from_unrolled, pose.psi_rad);
        ASSERT_TRUE(line);
        const ShaftPose truth = scenes::pose_of(shot.rig, 0, shot.q);
        const auto expected =
            centre_line(shot.rig.camera, shot.rig.instruments[0].marker, truth.camera_from_unrolled, truth.psi_rad);
        nearest_px = std::min(nearest_px, std::max((line->ideal_px[0] - expected->ideal_px[0]).norm(),
                                                   (line->ideal_px[3] - expected->ideal_px[3]).norm()));
        EXPECT_EQ(unknowns.through_rcm(), rcm);
      }
      EXPECT_LT(nearest_px, 24);
    }
}

TEST(InitialPoses, AreNoneForABlobWithoutTheMarkersColoursInTheirOrder) {
  const Shot& shot = usual_shot(1);
  Blob blob;  // of one colour only
  blob.grid_px = 8;
  for (int i = 0; i < 30; ++i) blob.samples.push_back({300 + 8 * (i % 6), 200 + 8 * (i / 6), 1});
  EXPECT_TRUE(starts_in(shot.sight.scene(), blob, std::nullopt).poses.empty());
  EXPECT_TRUE(starts_in(shot.sight.scene(), Blob{}, std::nullopt).poses.empty());
}

}  // namespace
}  // namespace lapservo::internal
