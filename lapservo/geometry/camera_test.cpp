#include "lapservo/geometry/camera.h"

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal::camera_test {

constexpr std::uint64_t seed = 21;

struct Lens {
  std::string name;
  Camera camera;
};

Camera camera_with(const std::array<double, 5>& distortion) {
  return {1280, 720, 1100, 1080, 650.5, 349, distortion, {}};
}

std::vector<Lens> lenses() {
  return {{"pinhole", camera_with({})},
          {"barrel", camera_with({-0.35, 0.15, 0, 0, 0})},
          {"pincushion", camera_with({0.2, 0.05, 0, 0, 0.01})},
          {"tangential", camera_with({0, 0, 0.004, -0.003, 0})},
          {"endoscope", camera_with({-0.28, 0.11, 0.0012, -0.0008, -0.03})}};
}

// A point that the camera sees, 0.03 m to 0.3 m away.
Eigen::Vector3d visible_point(const Camera& camera, Random& random) {
  const Eigen::Vector2d pixel(random.uniform(0, camera.width_px - 1), random.uniform(0, camera.height_px - 1));
  return camera.ray_from_ideal(*camera.ideal_from_raw(pixel)) * random.uniform(0.03, 0.3);
}

TEST(Camera, IdealAndRawPixelsRoundTripOverTheImage) {
  for (const auto& [name, camera] : lenses())
    for (double v_px = 0; v_px < camera.height_px; v_px += 719.0 / 12)
      for (double u_px = 0; u_px < camera.width_px; u_px += 1279.0 / 16) {
        const Eigen::Vector2d raw_px(u_px, v_px);
        const auto ideal_px = camera.ideal_from_raw(raw_px);
        ASSERT_TRUE(ideal_px) << name << " at " << raw_px.transpose();
        ASSERT_LT((camera.raw_from_ideal(*ideal_px) - raw_px).norm(), 1e-8) << name << " at " << raw_px.transpose();
      }
}

// The model's formula written out once more, for one point, from the ROS camera_info documentation.
TEST(Camera, PlumbBobOfOnePoint) {
  const Camera camera = camera_with({-0.3, 0.1, 0.002, -0.001, 0.05});
  const double x = 0.3, y = -0.2, r2 = 0.13;
  const double radial = 1 - 0.3 * r2 + 0.1 * r2 * r2 + 0.05 * r2 * r2 * r2;
  const double xd = x * radial + 2 * 0.002 * x * y + -0.001 * (r2 + 2 * x * x);
  const double yd = y * radial + 0.002 * (r2 + 2 * y * y) + 2 * -0.001 * x * y;
  const Eigen::Vector2d raw_px = camera.raw_from_point({x * 0.1, y * 0.1, 0.1});
  EXPECT_NEAR(raw_px.x(), 650.5 + 1100 * xd, 1e-9);
  EXPECT_NEAR(raw_px.y(), 349 + 1080 * yd, 1e-9);
}

TEST(Camera, TheRayThroughAPixelProjectsToIt) {
  testing::SeededRandom random(seed);
  for (const auto& [name, camera] : lenses())
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d point = visible_point(camera, random);
      const Eigen::Vector2d ideal_px = camera.ideal_from_point(point);
      const Eigen::Vector3d ray = camera.ray_from_ideal(ideal_px);
      EXPECT_EQ(ray.z(), 1);
      EXPECT_LT(ray.cross(point.normalized()).norm(), 1e-12) << name;
      EXPECT_LT((camera.raw_from_point(point) - camera.raw_from_ideal(ideal_px)).norm(), 1e-9);
    }
}

TEST(Camera, JacobiansAreTheDerivatives) {
  constexpr double step_m = 1e-7;
  testing::SeededRandom random(seed);
  for (const auto& [name, camera] : lenses())
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3d point = visible_point(camera, random);
      const auto raw = camera.raw_with_jacobian(point), ideal = camera.ideal_with_jacobian(point);
      EXPECT_LT((raw.point_px - camera.raw_from_point(point)).norm(), 1e-9) << name;
      EXPECT_LT((ideal.point_px - camera.ideal_from_point(point)).norm(), 1e-9) << name;
      for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Vector3d step = step_m * Eigen::Vector3d::Unit(axis);
        const Eigen::Vector2d raw_slope =
            (camera.raw_from_point(point + step) - camera.raw_from_point(point - step)) / (2 * step_m);
        const Eigen::Vector2d ideal_slope =
            (camera.ideal_from_point(point + step) - camera.ideal_from_point(point - step)) / (2 * step_m);
        const double tolerance = 1e-6 * camera.fx_px / point.z();
        EXPECT_LT((raw.d_px_d_point.col(axis) - raw_slope).norm(), tolerance) << name;
        EXPECT_LT((ideal.d_px_d_point.col(axis) - ideal_slope).norm(), tolerance) << name;
      }
    }
}

TEST(Camera, APointBeyondTheFoldOfABarrelLensHasNoRay) {
  // r (1 - 0.4 r^2) turns at r = 0.913, where it is 0.609: no ray arrives further out than 670 px from the centre.
  const Camera camera = camera_with({-0.4, 0, 0, 0, 0});
  EXPECT_TRUE(camera.ideal_from_raw({650.5 + 660, 349}));
  EXPECT_FALSE(camera.ideal_from_raw({650.5 + 680, 349}));
  EXPECT_FALSE(camera.ideal_from_raw({1e6, 1e6}));
  EXPECT_FALSE(camera.ideal_from_raw({std::numeric_limits<double>::quiet_NaN(), 0}));
}

TEST(Camera, WhatHasARayHasTheInnermostOne) {
  const Camera camera = camera_with({-0.4, 0, 0, 0, 0});
  testing::SeededRandom random(seed);
  int with_ray = 0;
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector2d raw_px(random.uniform(-200, 1500), random.uniform(-200, 900));
    const auto ideal_px = camera.ideal_from_raw(raw_px);
    if (!ideal_px) continue;
    ++with_ray;
    EXPECT_LT(Eigen::Vector2d(camera.ray_from_ideal(*ideal_px).head<2>()).norm(), 0.9129);
  }
  EXPECT_GT(with_ray, 300);
}

TEST(Camera, ContainsTheCentresOfItsPixels) {
  const Camera camera = camera_with({});
  EXPECT_TRUE(camera.contains({0, 0}));
  EXPECT_TRUE(camera.contains({1279, 719}));
  EXPECT_FALSE(camera.contains({1279.1, 719}));
  EXPECT_FALSE(camera.contains({-0.1, 0}));
  EXPECT_TRUE(camera.contains({5, 5}, 5));
  EXPECT_FALSE(camera.contains({4.9, 5}, 5));
  EXPECT_FALSE(camera.contains({std::numeric_limits<double>::quiet_NaN(), 5}));
}

}  // namespace lapservo::internal::camera_test
