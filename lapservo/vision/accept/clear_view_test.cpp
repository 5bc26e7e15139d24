#include "lapservo/vision/accept/clear_view.h"

#include <cstddef>
#include <cstdint>
#include <string>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal {
namespace clear_view_test {
namespace {

using scenes::Shot;
using scenes::Sight;
using scenes::usual_shot;

ShaftPose moved_along(const Shot& shot, double along_m) {
  return shot.truth(true).changed_by(along_m * PoseVector::Unit(4)).pose();
}

// The frame with a stripe of blood along a boundary.
cv::Mat with_blood_along(const Shot& shot, std::size_t boundary) {
  constexpr int lines = 200, radius_px = 6;
  cv::Mat bloody = shot.bgr.clone();
  const ShaftPose pose = moved_along(shot, 0);
  const Marker& marker = shot.rig.instruments[0].marker;
  for (int i = 0; i < lines; ++i) {
    const double azimuth_rad = two_pi * i / lines;
    const double along_m = boundaries_m(marker, marker_azimuth_rad(marker, azimuth_rad, pose.psi_rad))[boundary];
    const Eigen::Vector3d point = pose.camera_from_unrolled * surface_point(marker.radius_m(), azimuth_rad, along_m);
    const Eigen::Vector2d at_px = shot.rig.camera.raw_from_point(point);
    cv::circle(bloody, cv::Point(static_cast<int>(at_px.x()), static_cast<int>(at_px.y())), radius_px, {10, 10, 70},
               cv::FILLED);
  }
  return bloody;
}

TEST(ClearView, NothingHidesABoundaryButBlood) {
  constexpr int lines = 40;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Shot& shot = usual_shot(seed);
    const ShaftPose pose = moved_along(shot, 0);
    for (const std::size_t boundary : {0U, 1U, 2U, 3U}) {
      EXPECT_GT(lines_in_clear_view(shot.sight.scene(), pose, boundary, lines), lines / 2) << boundary;
      const Sight bloody(shot.rig, with_blood_along(shot, boundary));
      EXPECT_LE(lines_in_clear_view(bloody.scene(), pose, boundary, lines), 2) << boundary;
      // A misprint is no blood.
      EXPECT_GT(lines_in_clear_view(shot.sight.scene(), moved_along(shot, 0.3e-3), boundary, lines), lines / 3)
          << boundary;
    }
  }
}

}  // namespace
}  // namespace clear_view_test
}  // namespace lapservo::internal
