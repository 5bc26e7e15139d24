#include "lapservo/vision/search/coarse_fit.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/testing/shots.h"

namespace lapservo::internal::coarse_fit_test {

using namespace scenes;

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
  scenes::for_each_shot(8, [](const Shot& shot) {
    for (const bool rcm : {true, false}) {
      SCOPED_TRACE(rcm ? "through the RCM" : "free");
      Random random(shot.seed + 50);
      const PoseUnknowns truth = shot.truth(rcm);
      const CoarseFit fit = fit_coarsely(shot.sight.scene(), truth.changed_by(large_offset(random)), Rotation::unknown);
      ASSERT_TRUE(fit.found);
      EXPECT_LT(miss_px(shot, fit.unknowns.pose()), 2.5);
      EXPECT_LT(std::abs(shot.psi_error_rad(fit.unknowns.pose().psi_rad)), 0.1);
      EXPECT_GT(fit.rotation_score, 0.85);
      EXPECT_LT(fit.rival_score, 0.9 * fit.rotation_score);
    }
  });
}

TEST(CoarseFit, KeepsAGivenRotationWhenNotAskedToSearch) {
  scenes::for_each_shot(6, [](const Shot& shot) {
    PoseVector offset;
    offset << 0.004, -0.003, 3e-4, 3e-4, 1e-3, 0.05;
    const CoarseFit fit = fit_coarsely(shot.sight.scene(), shot.truth(true).changed_by(offset), Rotation::known);
    ASSERT_TRUE(fit.found);
    EXPECT_LT(miss_px(shot, fit.unknowns.pose()), 3);
    EXPECT_EQ(fit.rotation_score, 0);
  });
}

TEST(CoarseFit, FindsNothingInTissueNorFarFromTheMarker) {
  const Shot& shot = usual_shot(2);
  const Sight empty(shot.rig, scenes::render_nothing(shot.rig, 3));
  EXPECT_FALSE(fit_coarsely(empty.scene(), shot.truth(true), Rotation::unknown).found);
  PoseVector offset = PoseVector::Zero();
  offset[1] = 1.5;
  EXPECT_FALSE(fit_coarsely(shot.sight.scene(), shot.truth(false).changed_by(offset), Rotation::unknown).found);
}

}  // namespace lapservo::internal::coarse_fit_test
