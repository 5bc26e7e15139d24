#include "lapservo/vision/search/starts.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/testing/shots.h"

namespace lapservo::internal::starts_test {

using scenes::Shot;

constexpr std::uint64_t shots = 6;

Eigen::Vector2d middle_px(const Shot& shot, const ShaftPose& pose) {
  const Eigen::Vector3d along(0, 0, shot.rig.instruments[0].marker.length_m() / 2);
  return shot.rig.camera.raw_from_point(pose.camera_from_unrolled * along);
}

// Whether a coarse fit finds the marker from there: its middle and its depth are about right.
bool is_near(const Shot& shot, const PoseUnknowns& start) {
  constexpr double near_px = 25, near_depth = 0.15;
  const ShaftPose truth = shot.truth(true).pose();
  const double depth =
      start.pose().camera_from_unrolled.translation.norm() / truth.camera_from_unrolled.translation.norm();
  return (middle_px(shot, start.pose()) - middle_px(shot, truth)).norm() < near_px && std::abs(depth - 1) < near_depth;
}

bool any_is_near(const Shot& shot, const std::vector<PoseUnknowns>& starts) {
  return std::any_of(starts.begin(), starts.end(), [&](const PoseUnknowns& start) { return is_near(shot, start); });
}

Blob largest_blob(const Shot& shot) {
  return largest_blobs(shot.sight.view(), shot.sight.classes()).at(0);
}

TEST(Starts, ABlobTellsThePoseAndSoDoLinesThroughTheRcm) {
  scenes::for_each_shot(shots, [](const Shot& shot) {
    for (const auto& rcm : {shot.rig.instruments[0].camera_from_rcm, std::optional<Rigid3>()}) {
      const Starts starts = starts_in(shot.sight.scene(), largest_blob(shot), rcm);
      EXPECT_TRUE(any_is_near(shot, starts.poses));
      for (const PoseUnknowns& start : starts.poses) EXPECT_EQ(start.through_rcm(), rcm.has_value());
      EXPECT_TRUE(rcm ? starts.poses.size() <= 3 : !starts.other_bands);
    }
  });
}

// A shaft along the rows, of which the image shows the upper half or less.
TEST(Starts, ASideBeyondTheBorderIsADiameterFromTheOther) {
  Rig rig = scenes::usual_rig();
  Rigid3& camera_from_rcm = *rig.instruments[0].camera_from_rcm;
  camera_from_rcm.translation = {-0.12, 0, 0.1};
  const double length_m = rig.instruments[0].marker.length_m(), radius_m = rig.instruments[0].marker.radius_m();
  const JointVector q = configuration_through(camera_from_rcm, {-length_m / 2, 0, 0.1}).value();
  const cv::Mat whole = scenes::render(rig, {q}, 1);
  const double radius_px = radius_m / 0.1 * rig.camera.fy_px, axis_px = rig.camera.cy_px;
  for (const double shown : {-0.4, 0.0, 0.4}) {
    SCOPED_TRACE("so many radii beside the axis: " + std::to_string(shown));
    rig.camera.height_px = static_cast<int>(axis_px + shown * radius_px);
    const scenes::Sight sight(rig, whole.rowRange(0, rig.camera.height_px));
    const auto starts =
        starts_in(sight.scene(), largest_blobs(sight.view(), sight.classes()).at(0), rig.instruments[0].camera_from_rcm)
            .poses;
    ASSERT_FALSE(starts.empty());
    const Rigid3& pose = starts[0].pose().camera_from_unrolled;
    EXPECT_NEAR(rig.camera.raw_from_point(pose.translation).y(), axis_px, 0.25 * radius_px);
    EXPECT_NEAR(pose.translation.z(), 0.1, 0.01);
  }
}

// Another instrument's colours are in another order; other things have one colour.
TEST(Starts, AreNoneWithoutTheMarkersColoursInTheirOrder) {
  Blob of_one_colour;
  for (int i = 0; i < 30; ++i) of_one_colour.samples.push_back({300 + 8 * (i % 6), 200 + 8 * (i / 6), 1});
  scenes::for_each_shot(shots, [&](const Shot& shot) {
    Scene another = shot.sight.scene();
    std::swap(another.bands[1], another.bands[2]);
    for (const auto& rcm : {shot.rig.instruments[0].camera_from_rcm, std::optional<Rigid3>()})
      EXPECT_TRUE(starts_in(another, largest_blob(shot), rcm).poses.empty());
    for (const Blob& blob : {of_one_colour, Blob{}})
      EXPECT_TRUE(starts_in(shot.sight.scene(), blob, std::nullopt).poses.empty());
  });
}

}  // namespace lapservo::internal::starts_test
