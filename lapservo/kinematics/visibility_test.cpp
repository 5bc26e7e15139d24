#include "lapservo/kinematics/visibility.h"

#include <cmath>
#include <string>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lapservo/geometry/cylinder.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/kinematics/test_models.h"
#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal::visibility_test {

constexpr double any_steepness_rad = 1.57;

// A shaft with the middle of its marker at a place, leaning away from the camera as seen from there, turned in the
// image.
Rigid3 leaning_shaft(const Marker& marker, const Eigen::Vector3d& middle_m, double lean_rad, double turn_rad) {
  const Eigen::Vector3d sight = middle_m.normalized(), across = sight.unitOrthogonal();
  const Eigen::Vector3d axis =
      Eigen::AngleAxisd(turn_rad, sight) * (std::cos(lean_rad) * across + std::sin(lean_rad) * sight).eval();
  const Eigen::Quaterniond rotation = rotation_between(Eigen::Vector3d::UnitZ(), axis);
  return {rotation, middle_m - marker.length_m() / 2 * axis};
}

bool every_seen_point_in_image(const Camera& camera, const Marker& marker, const Rigid3& pose, double border_px) {
  constexpr int across = 20, along = 10;
  const CylinderView view = view_cylinder(pose, marker.radius_m()).value();
  for (int i = -across; i <= across; ++i)
    for (int j = 0; j <= along; ++j) {
      const Eigen::Vector3d point =
          pose * surface_point(marker.radius_m(), view.facing_azimuth_rad + view.half_visible_rad * i / across,
                               marker.length_m() * j / along);
      if (!camera.contains(camera.raw_from_point(point), border_px)) return false;
    }
  return true;
}

TEST(Visibility, IsThatOfEveryPointOfTheSideThatFacesTheCamera) {
  constexpr double border_px = 25, between_points_px = 10, steepest_rad = 0.6;
  testing::SeededRandom random(61);
  int in_view = 0, out_of_view = 0;
  for (const ImageModel& model : testing::image_models())
    for (int trial = 0; trial < 400; ++trial) {
      const Rigid3 pose = model.camera_from_rcm * rcm_from_unrolled(testing::visible_configuration(model, random));
      SCOPED_TRACE("trial " + std::to_string(trial));
      if (marker_in_view(model.camera, model.marker, pose, {steepest_rad, border_px})) {
        ++in_view;
        EXPECT_TRUE(every_seen_point_in_image(model.camera, model.marker, pose, border_px - between_points_px));
      }
      if (!marker_in_view(model.camera, model.marker, pose, {any_steepness_rad, border_px})) {
        ++out_of_view;
        EXPECT_FALSE(every_seen_point_in_image(model.camera, model.marker, pose, border_px));
      }
    }
  EXPECT_GT(in_view, 200);
  EXPECT_GT(out_of_view, 100);
}

TEST(Visibility, EndsWhereTheShaftLeansTooSteeply) {
  testing::SeededRandom random(62);
  const ImageModel model = testing::image_models().front();
  for (int trial = 0; trial < 200; ++trial) {
    const double steepest_rad = random.uniform(0.1, 1), turn_rad = random.uniform(-pi, pi);
    const Eigen::Vector3d middle_m(random.uniform(-0.01, 0.01), random.uniform(-0.01, 0.01), 0.12);
    for (const double side : {-1.0, 1.0})
      for (const double fraction : {0.99, 1.01}) {
        const Rigid3 pose = leaning_shaft(model.marker, middle_m, side * fraction * steepest_rad, turn_rad);
        EXPECT_EQ(marker_in_view(model.camera, model.marker, pose, {steepest_rad, 10}), fraction < 1)
            << "trial " << trial;
      }
  }
}

TEST(Visibility, IsNoneBehindOrInsideTheCamera) {
  const ImageModel model = testing::image_models().front();
  const auto in_view = [&](const Eigen::Vector3d& middle_m) {
    return marker_in_view(model.camera, model.marker, leaning_shaft(model.marker, middle_m, 0, 0.3),
                          {any_steepness_rad, 0});
  };
  EXPECT_TRUE(in_view({0, 0, 0.1}));
  EXPECT_FALSE(in_view({0, 0, -0.1}));
  EXPECT_FALSE(in_view({0, 0, 0.5 * model.marker.radius_m()}));
}

// A barrel lens's polynomial brings back what is far outside.
TEST(Visibility, IsNotMistakenWhereTheLensFoldsBack) {
  ImageModel model = testing::image_models().front();
  model.camera.distortion = {-0.3, 0, 0, 0, 0};
  const Rigid3 pose = leaning_shaft(model.marker, {0.175, 0, 0.1}, 0, 0);
  EXPECT_TRUE(every_seen_point_in_image(model.camera, model.marker, pose, 0));
  EXPECT_FALSE(marker_in_view(model.camera, model.marker, pose, {any_steepness_rad, 0}));
}

TEST(Visibility, RandomConfigurationsAreInViewWithinTheDepthAskedFor) {
  constexpr ViewRange range{0.06, 0.16, {any_steepness_rad, 20}};
  for (const ImageModel& model : testing::image_models()) {
    Random random(62);
    for (int i = 0; i < 20; ++i) {
      const auto q = random_configuration_in_view(model.camera, model.marker, model.camera_from_rcm, range, random);
      ASSERT_TRUE(q);
      const Rigid3 pose = model.camera_from_rcm * rcm_from_unrolled(*q);
      EXPECT_TRUE(marker_in_view(model.camera, model.marker, pose, range.limits));
      EXPECT_GE(pose.translation.z(), range.nearest_m);
      EXPECT_LE(pose.translation.z(), range.farthest_m);
    }
  }
}

TEST(Visibility, NoRandomConfigurationWhereNoneIsInView) {
  const ImageModel model = testing::image_models()[0];
  const ViewRange wider_than_the_image{0.06, 0.16, {.steepest_rad = 0.9, .border_px = 400}};
  Random random(63);
  EXPECT_FALSE(
      random_configuration_in_view(model.camera, model.marker, model.camera_from_rcm, wider_than_the_image, random));
}

}  // namespace lapservo::internal::visibility_test
