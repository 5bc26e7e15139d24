#include "lapservo/vision/edges/edge_measurements.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <gtest/gtest.h>

#include "lapservo/testing/scenes.h"

namespace lapservo::internal {
namespace {

constexpr Effort effort{3, 3, 3, 1};

TEST(EdgeMeasurements, WhatTheLensFoldsIntoTheImageIsNotLookedFor) {
  Rig rig = scenes::usual_rig();
  rig.camera.distortion = {-0.3, 0, 0, 0, 0};
  const scenes::Sight sight(rig, scenes::render_nothing(rig, 1));
  ShaftPose pose = scenes::usual_shot(1).truth(true).pose();
  pose.camera_from_unrolled.translation = Eigen::Vector3d(0.18, 0, 0.1);
  const EdgeMeasurements edges =
      measure_edges(sight.scene(), sight.light(), PoseUnknowns(pose, false), film_mean_m, effort, {});
  EXPECT_EQ(edges.in_image, (std::array<int, 4>{}));
  EXPECT_EQ(edges.sides_in_image, 0);
}

// The noise that each point has is what its residual is like.
TEST(EdgeMeasurements, ResidualsAtTheTrueRotationAreAboutASigma) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const scenes::Shot& shot = scenes::usual_shot(seed);
    const EdgeMeasurements edges =
        measure_edges(shot.sight.scene(), shot.sight.light(), shot.truth(true), film_mean_m, effort, {});
    EXPECT_GT(edges.all.size(), 100U) << "seed " << seed;
    const auto far = std::count_if(edges.all.begin(), edges.all.end(),
                                   [](const Measurement& m) { return std::abs(m.residual_px) > 4 * m.sigma_px; });
    EXPECT_LT(far, static_cast<std::ptrdiff_t>(edges.all.size()) / 10) << "seed " << seed;
  }
}

}  // namespace
}  // namespace lapservo::internal
