#include "lapservo/vision/edges/edge_measurements.h"

#include <array>

#include <gtest/gtest.h>

#include "lapservo/testing/scenes.h"

namespace lapservo::internal::edge_measurements_test {

TEST(EdgeMeasurements, WhatTheLensFoldsIntoTheImageIsNotLookedFor) {
  Rig rig = scenes::usual_rig();
  rig.camera.distortion = {-0.3, 0, 0, 0, 0};
  const scenes::Sight sight(rig, scenes::render_nothing(rig, 1));
  ShaftPose pose = scenes::usual_shot(1).truth(true).pose();
  pose.camera_from_unrolled.translation = Eigen::Vector3d(0.18, 0, 0.1);
  const EdgeMeasurements edges =
      measure_edges(sight.scene(), sight.light(), PoseUnknowns(pose, false), film_mean_m, {3, 3, 3, 1}, {});
  EXPECT_EQ(edges.in_image, (std::array<int, 4>{}));
  EXPECT_EQ(edges.sides_in_image, 0);
}

}  // namespace lapservo::internal::edge_measurements_test
