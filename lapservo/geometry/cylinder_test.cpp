#include "lapservo/geometry/cylinder.h"

#include <cstdint>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal::cylinder_test {

constexpr std::uint64_t seed = 22;
constexpr double radius_m = 0.0042;

Eigen::Quaterniond random_rotation(Random& random) {
  return Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), random.normal()).normalized();
}

// A shaft somewhere before the camera, in any direction.
Rigid3 random_shaft(Random& random) {
  return {random_rotation(random),
          {random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05), random.uniform(0.05, 0.2)}};
}

template <typename Law>
void for_random_shafts(const Law& law) {
  testing::SeededRandom random(seed);
  int checked = 0;
  for (int i = 0; i < 300; ++i) {
    SCOPED_TRACE("shaft " + std::to_string(i));
    const Rigid3 camera_from_cylinder = random_shaft(random);
    const auto view = view_cylinder(camera_from_cylinder, radius_m);
    if (!view) continue;  // the camera sits inside the extended shaft
    law(camera_from_cylinder, *view, random.uniform(-0.05, 0.05));
    ++checked;
  }
  EXPECT_GT(checked, 200);
}

Eigen::Vector3d normal_in_camera(const Rigid3& camera_from_cylinder, double azimuth_rad) {
  return camera_from_cylinder.rotation * surface_point(1, azimuth_rad, 0);
}

// Normal times ray is a sine of the azimuth and a constant: where it is negative amid both zeros, it is between them
// only.
TEST(Cylinder, SilhouetteRaysAreTangentAndBetweenThemTheSurfaceFacesTheCamera) {
  for_random_shafts([](const Rigid3& pose, const CylinderView& view, double along_m) {
    const auto normal_times_ray = [&](double offset_rad) {
      const double azimuth_rad = view.facing_azimuth_rad + offset_rad;
      return normal_in_camera(pose, azimuth_rad)
          .dot((pose * surface_point(radius_m, azimuth_rad, along_m)).normalized());
    };
    EXPECT_GT(view.half_visible_rad, 0);
    EXPECT_LT(view.half_visible_rad, pi / 2);
    EXPECT_NEAR(normal_times_ray(-view.half_visible_rad), 0, 1e-9);
    EXPECT_NEAR(normal_times_ray(view.half_visible_rad), 0, 1e-9);
    EXPECT_LT(normal_times_ray(0), 0);
  });
}

TEST(Cylinder, ACameraInsideTheShaftSeesNothing) {
  const Rigid3 along_the_view{Eigen::Quaterniond::Identity(), {0.004, 0, 0.1}};
  EXPECT_FALSE(view_cylinder(along_the_view, radius_m));
  EXPECT_TRUE(view_cylinder(along_the_view, 0.0039));
}

}  // namespace lapservo::internal::cylinder_test
