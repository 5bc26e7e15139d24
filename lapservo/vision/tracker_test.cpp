#include "lapservo/vision/tracker.h"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/error.h"
#include "lapservo/core/random.h"
#include "lapservo/rig/registration_covariance.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal::tracker_test {

using scenes::usual_shot;

// Else `for (const Observation& o : Tracker(rig).track(image))` reads freed memory.
static_assert(std::is_same_v<decltype(std::declval<Tracker>().track(cv::Mat())), std::vector<Observation>>);

TEST(Tracker, NamesTheInstrumentWhateverBecomesOfIt) {
  const auto& shot = usual_shot(1);
  Tracker tracker(shot.rig);
  const std::string& name = shot.rig.instruments[0].name;
  EXPECT_EQ(tracker.track(shot.bgr)[0].instrument, name);
  EXPECT_EQ(tracker.track(cv::Mat::zeros(shot.bgr.size(), CV_8UC3))[0].instrument, name);
  EXPECT_EQ(tracker.refuse(Status::damaged)[0].instrument, name);
  EXPECT_EQ(tracker.refuse(Status::damaged)[0].status, Status::damaged);
}

// As if the rig had said so.
TEST(Tracker, TakesAnotherRegistration) {
  const auto& shot = usual_shot(1);
  for (const Method method : {Method::surface, Method::centerline}) {
    Rig known = shot.rig, other = shot.rig;
    known.instruments[0].registration_covariance = Eigen::Matrix<double, 6, 6>::Identity() * 1e-8;
    other.instruments[0].camera_from_rcm->translation.x() += 0.01;
    Tracker tracker(other, {.method = method});
    tracker.set_registration(0, *shot.rig.instruments[0].camera_from_rcm,
                             *known.instruments[0].registration_covariance);
    const Observation got = tracker.track(shot.bgr)[0],
                      expected = Tracker(known, {.method = method}).track(shot.bgr)[0];
    ASSERT_TRUE(got.rcm && expected.rcm);
    EXPECT_EQ(got.rcm->q.vector(), expected.rcm->q.vector());
    EXPECT_EQ(got.rcm->covariance, expected.rcm->covariance);
    EXPECT_EQ(got.features.r_px, expected.features.r_px);
  }
  EXPECT_THROW(Tracker(shot.rig).set_registration(1, {}, Eigen::Matrix<double, 6, 6>::Zero()), std::out_of_range);
}

// Also for which shaft may cover which, where the rig has none.
TEST(Tracker, TakesTheFirstRegistration) {
  const Rig rig = scenes::usual_rig(2);
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const cv::Mat image = scenes::render(rig, scenes::crossing_pair(rig, random).q, seed);
    Tracker tracker(scenes::without_rcm(rig), {.frame_budget = std::nullopt}),
        known(rig, {.frame_budget = std::nullopt});
    for (std::size_t i = 0; i < 2; ++i)
      tracker.set_registration(i, *rig.instruments[i].camera_from_rcm, registration_covariance(rig.instruments[i]));
    const auto& got = tracker.track(image);
    const auto& expected = known.track(image);
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_EQ(got[i].status, expected[i].status);
      EXPECT_EQ(got[i].p_false, expected[i].p_false);
      ASSERT_EQ(got[i].rcm.has_value(), expected[i].rcm.has_value());
      if (got[i].rcm) {
        EXPECT_EQ(got[i].rcm->q.vector(), expected[i].rcm->q.vector());
      }
    }
  }
}

TEST(Tracker, RefusesOtherImagesThanTheRigs) {
  Tracker tracker(scenes::usual_rig());
  EXPECT_THROW(tracker.track(cv::Mat::zeros(540, 961, CV_8UC3)), InputError);
  EXPECT_THROW(tracker.track(cv::Mat::zeros(541, 960, CV_8UC3)), InputError);
  EXPECT_THROW(tracker.track(cv::Mat::zeros(540, 960, CV_8UC1)), InputError);
  EXPECT_THROW(tracker.track(cv::Mat()), InputError);
}

TEST(Tracker, RefusesABudgetOfNothing) {
  for (const double nothing : {0.0, -1.0, std::nan("")})
    EXPECT_THROW(Tracker(scenes::usual_rig(), {.frame_budget = nothing}), InputError) << nothing;
  EXPECT_THROW(Tracker(Rig{}), InputError) << "put together in a program";
}

}  // namespace lapservo::internal::tracker_test
