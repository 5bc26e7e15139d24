#include "lapservo/rcm/line_observation.h"

#include <limits>

#include <gtest/gtest.h>

#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/rcm/test_lines.h"

namespace lapservo::internal {
namespace {

TEST(LineObservation, LinesThroughAPointMeetThere) {
  constexpr std::uint64_t seed = 61;
  Random random(seed);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Vector2d point(random.uniform(-2000, 2000), random.uniform(-2000, 2000));
    const auto lines = testing::fan_of_lines(point, 2, 1, random);
    const auto met = intersection_px(lines[0], lines[1]);
    ASSERT_TRUE(met) << "seed " << seed;
    EXPECT_LT((*met - point).norm(), 1e-4) << "seed " << seed;
  }
}

TEST(LineObservation, ParallelLinesDoNotMeet) {
  EXPECT_FALSE(intersection_px(line_between({0, 0}, {100, 50}, 1), line_between({0, 10}, {200, 110}, 1)));
}

TEST(LineObservation, ToldApartFromWhatIsNone) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(is_usable(line_between({0, 0}, {100, 50}, 1)));
  EXPECT_FALSE(is_usable(line_between({7, 7}, {7, 7}, 1)));
  EXPECT_FALSE(is_usable(line_between({nan, 0}, {100, 50}, 1)));
  EXPECT_FALSE(is_usable(line_between({0, 0}, {1e200, 50}, 1)));
  EXPECT_FALSE(is_usable(line_between({0, 0}, {100, 50}, nan)));
}

// A shaft as thick as it likes: the facing generatrix's image passes through that of every point of the axis.
TEST(LineObservation, FacingGeneratrixPassesThroughTheImageOfTheAxis) {
  constexpr std::uint64_t seed = 62;
  Random random(seed);
  const Camera camera{1280, 720, 1100, 1050, 639.5, 359.5, {}, {}};
  int checked = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Quaterniond turn =
        Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), random.normal()).normalized();
    const Rigid3 camera_from_shaft{turn, {random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), 0.3}};
    const double radius_m = random.uniform(0.001, 0.02);
    const auto view = view_cylinder(camera_from_shaft, radius_m);
    if (!view) continue;
    const auto image = [&](double along_m) {
      return camera.ideal_from_point(camera_from_shaft * surface_point(radius_m, view->facing_azimuth_rad, along_m));
    };
    const Eigen::Vector2d from = image(0.02), along = (image(0.06) - from).normalized();
    const Eigen::Vector2d arm = camera.ideal_from_point(camera_from_shaft.translation) - from;
    EXPECT_NEAR(along.x() * arm.y() - along.y() * arm.x(), 0, 1e-8) << "seed " << seed << ", radius " << radius_m;
    ++checked;
  }
  EXPECT_GT(checked, 100);
}

}  // namespace
}  // namespace lapservo::internal
