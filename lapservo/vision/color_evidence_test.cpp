#include "lapservo/vision/color_evidence.h"

#include <string>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/testing/scenes.h"
#include "lapservo/vision/verification.h"

namespace lapservo::internal {
namespace color_evidence_test {
namespace {

using scenes::Shot;
using scenes::Sight;
using scenes::usual_shot;

ShaftPose moved_along(const Shot& shot, double along_m) {
  return shot.truth(true).changed_by(Eigen::Vector4d(0, 0, along_m, 0)).pose();
}

TEST(ColorEvidence, ShowsBothColorsBesideABoundaryOnly) {
  constexpr int lines = 40;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Shot& shot = usual_shot(seed);
    const Scene scene = shot.sight.scene();
    for (const std::size_t boundary : {1U, 2U}) {
      EXPECT_GT(lines_with_both_colors(scene, moved_along(shot, 0), boundary, lines), lines / 2);
      EXPECT_LE(lines_with_both_colors(scene, moved_along(shot, 1.5e-3), boundary, lines), 1);
    }
  }
}

TEST(ColorEvidence, WhatSpillsIsAnEndElsewhereAndNoNoise) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Shot& shot = usual_shot(seed);
    const ShaftPose right = moved_along(shot, 0);
    EXPECT_LT(spilled_in_patches(shot.sight.scene(), right), 0.02);
    EXPECT_GT(spilled_in_patches(shot.sight.scene(), moved_along(shot, 2e-3)), 0.5);
    // A fifth of all pixels with the end's colour, no two of them neighbours but by chance.
    cv::Mat noisy = shot.bgr.clone();
    Random random(seed);
    for (int v = 0; v < noisy.rows; ++v)
      for (int u = 0; u < noisy.cols; ++u)
        if (random.uniform(0, 1) < 0.2) noisy.at<cv::Vec3b>(v, u) = {200, 20, 110};
    const Sight sight(shot.rig, noisy);
    EXPECT_GT(color_agreement(sight.scene(), right).spilled, 0.12);
    EXPECT_LT(spilled_in_patches(sight.scene(), right), 0.12);
  }
}

}  // namespace
}  // namespace color_evidence_test
}  // namespace lapservo::internal
