#include "lapservo/calibration/check/work_space.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/testing/rigs.h"

namespace lapservo::internal::work_space_test {

double mean_of(const SigmaMap& map) {
  double sum = 0;
  int count = 0;
  for (const auto& sigma_rad : map.sigma_rad)
    if (sigma_rad) sum += *sigma_rad, ++count;
  return count ? sum / count : 0;
}

TEST(SigmaMaps, GrowWithDepthAndWithWhatTheCameraAdds) {
  const Rig rig = lapservo::testing::small_test_rig();
  const Rigid3& camera_from_rcm = *rig.instruments[0].camera_from_rcm;
  const auto q = configuration_through(camera_from_rcm, {-0.01, 0, 0.1});
  ASSERT_TRUE(q);
  MeasuredSigma measured{camera_from_rcm * rcm_from_unrolled(*q), 0.5, 1e-3};
  const auto maps = sigma_maps(rig, 0, {0.08, 0.13}, {measured});
  ASSERT_EQ(maps.size(), 2U);
  const double near_rad = mean_of(maps[0]), far_rad = mean_of(maps[1]);
  EXPECT_GT(near_rad, 1e-4);
  EXPECT_GT(far_rad, 1.3 * near_rad);
  EXPECT_LT(far_rad, 20e-3);
  // The marker would extend beyond the image's corners.
  EXPECT_FALSE(maps[0].sigma_rad.front() && maps[0].sigma_rad.back());
  measured.sigma_rad *= 3;
  EXPECT_NEAR(mean_of(sigma_maps(rig, 0, {0.08}, {measured})[0]), 3 * near_rad, 1e-6);
}

// So far away that the bands are a few pixels long.
TEST(SigmaMaps, TellWhereTheMarkerIsInViewButLost) {
  Rig rig = lapservo::testing::small_test_rig();
  const Rigid3 camera_from_rcm = *rig.instruments[0].camera_from_rcm;
  rig.instruments[0].camera_from_rcm.reset();  // else no far shaft that passes the RCM is in view
  const auto q = configuration_through(camera_from_rcm, {-0.01, 0, 0.1});
  ASSERT_TRUE(q);
  const auto maps = sigma_maps(rig, 0, {0.1, 1.0}, {{camera_from_rcm * rcm_from_unrolled(*q), 0.5, 1e-3}});
  const auto lost = [](const SigmaMap& map) { return std::count(map.lost.begin(), map.lost.end(), true); };
  EXPECT_EQ(lost(maps[0]), 0);
  EXPECT_GT(lost(maps[1]), 0);
  for (const SigmaMap& map : maps)
    for (std::size_t i = 0; i < SigmaMap::cells; ++i) EXPECT_FALSE(map.lost[i] && map.sigma_rad[i]);
}

}  // namespace lapservo::internal::work_space_test
