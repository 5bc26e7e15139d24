#include "lapservo/vision/camera/camera_departure.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/statistics.h"
#include "lapservo/testing/camera_effects.h"
#include "lapservo/testing/shots.h"
#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal::camera_departure_test {

using effects::CameraEffects;
using namespace scenes;

constexpr std::uint64_t frames = 12;

constexpr ChromaticAberration aberration{1.0015, 0.9985};

cv::Mat seen_through(const CameraEffects& camera, const Shot& shot) {
  return effects::seen_through(camera, shot.bgr, shot.rig.camera);
}

FineFit fit_to(const Shot& shot, const cv::Mat& bgr, const Expected& expected = {}) {
  const Sight sight(shot.rig, bgr);
  return fit_finely(sight.scene(), sight.light(), shot.truth(true), expected);
}

double psi_error_rad(const Shot& shot, const FineFit& fit) {
  return std::abs(shot.psi_error_rad(fit.unknowns));
}

// Passes what each frame through a camera that the rig does not know shows of it to `look`. psi is right, and better by
// such a factor than that of fits that do not ask.
template <typename Look>
void expect_found(const CameraEffects& camera, double part_of_error, const Look& look) {
  std::vector<double> asked_rad, unasked_rad;
  scenes::for_each_shot(frames, [&](const Shot& shot) {
    const cv::Mat seen = seen_through(camera, shot);
    const FineFit fit = fit_to(shot, seen);
    ASSERT_TRUE(fit.converged);
    look(fit.departure);
    asked_rad.push_back(psi_error_rad(shot, fit));
    unasked_rad.push_back(psi_error_rad(shot, fit_to(shot, seen, {.ask = false})));
    EXPECT_LT(asked_rad.back(), 3 * std::sqrt(fit.psi_variance_rad2()));
  });
  EXPECT_LT(median(asked_rad), part_of_error * median(unasked_rad));
}

TEST(CameraDeparture, MagnificationsThatTheRigDoesNotKnowAreFound) {
  expect_found({.aberration = aberration}, 0.3, [](const CameraDeparture& found) {
    EXPECT_EQ(found.exponent, 1);
    if (found.aberration == ChromaticAberration{}) return;  // near the middle of the image there is none
    EXPECT_LT(std::abs(found.aberration.blue - aberration.blue), 3 * found.sigma_aberration.blue);
    EXPECT_LT(std::abs(found.aberration.red - aberration.red), 3 * found.sigma_aberration.red);
  });
}

// Rec. 709's light is sRGB's to the power of 0.85 to 0.89.
TEST(CameraDeparture, AResponseThatIsNotTheRigsIsFound) {
  std::uint64_t shown = 0;
  expect_found({.rec709 = true}, 0.5, [&](const CameraDeparture& found) {
    EXPECT_EQ(found.aberration, ChromaticAberration{});
    if (found.exponent == 1) return;  // too little of it shows
    ++shown;
    EXPECT_NEAR(found.exponent, 0.87, 3 * found.sigma_exponent);
  });
  EXPECT_GE(4 * shown, 3 * frames);
}

// Nor does what a camera does beyond its response look like one.
TEST(CameraDeparture, CamerasAsTheRigSaysShowNone) {
  scenes::for_each_shot(frames, [](const Shot& shot) {
    EXPECT_FALSE(fit_to(shot, shot.bgr).departure.any());
    for (const char* condition : {"bayer", "vignette", "crosstalk", "chroma420"}) {
      const cv::Mat seen = seen_through(effects::draw(condition, shot.seed), shot);
      EXPECT_FALSE(fit_to(shot, seen).departure.any()) << condition;
    }
  });
}

TEST(CameraDeparture, IsKeptByFramesThatAreNotAsked) {
  const Shot& shot = usual_shot(3);
  const cv::Mat seen = seen_through({.aberration = aberration}, shot);
  const FineFit first = fit_to(shot, seen);
  ASSERT_TRUE(first.departure.any());
  const FineFit next = fit_to(shot, seen, {.ask = false, .departure = first.departure});
  EXPECT_EQ(next.departure.aberration, first.departure.aberration);
  EXPECT_NEAR(scenes::q_of(shot.rig, next.unknowns).psi_rad, scenes::q_of(shot.rig, first.unknowns).psi_rad, 3e-4);
  const FineFit again = fit_to(shot, seen, {.ask = true, .departure = first.departure});
  EXPECT_NEAR(again.departure.aberration.blue, first.departure.aberration.blue, 3e-4);
}

// Effects that are undone twice are undone by both.
TEST(CameraDeparture, OneAfterAnotherIsBoth) {
  const CameraDeparture first{.aberration = {1.001, 0.999}, .exponent = 0.9},
      more{.aberration = {1.002, 1}, .exponent = 0.95};
  const CameraDeparture both = first.then(more).value();
  const Shot& shot = usual_shot(1);
  const DepartedLight by_first(shot.sight.light(), first), by_more(by_first.light(), more);
  const DepartedLight by_both(shot.sight.light(), both);
  for (const float u : {100.0F, 333.3F, 700.7F})
    for (std::size_t c = 0; c < 3; ++c)
      EXPECT_NEAR(by_more.light().at(u, 250).light[c], by_both.light().at(u, 250).light[c], 1e-5);
}

// So is one that an earlier frame showed: of a camera that is as the rig says, by what is seen through it; of one that
// sharpens, whose channels' places do not count, by an image that looks better without.
TEST(CameraDeparture, IsWithdrawnWhereAFrameShowsItIsNone) {
  scenes::for_each_shot(6, [&](const Shot& shot) {
    const CameraDeparture wrong{.exponent = 0.8};
    const FineFit clean = fit_to(shot, shot.bgr, {.departure = wrong});
    ASSERT_TRUE(clean.converged);
    EXPECT_EQ(clean.departure.exponent, 1);
    EXPECT_EQ(clean.departure.aberration, ChromaticAberration{});
    EXPECT_LT(psi_error_rad(shot, clean), 3e-3);
    const cv::Mat sharpened = seen_through(effects::draw("sharpen", shot.seed), shot);
    const FineFit fit = fit_to(shot, sharpened, {.departure = wrong}), without = fit_to(shot, sharpened);
    ASSERT_TRUE(fit.converged);
    EXPECT_FALSE(fit.departure.any());
    EXPECT_NEAR(psi_error_rad(shot, fit), psi_error_rad(shot, without), 1e-3);
  });
}

TEST(CameraDeparture, IsNoneBeyondWhatCamerasHave) {
  const CameraDeparture dark{.exponent = 0.7}, aberrated{.aberration = {1.006, 1}};
  EXPECT_FALSE(dark.then(dark));
  EXPECT_FALSE(aberrated.then(aberrated));
  EXPECT_FALSE(CameraDeparture{}.then({.aberration = {1, 0.98}}));
  EXPECT_EQ(dark.then({.exponent = 1.4})->exponent, 1);
}

// A frame's evidence of one kind says nothing of the other.
TEST(CameraDeparture, DoubtOfBothKindsIsKept) {
  const CameraDeparture aberrated{.aberration = {1.001, 1}, .sigma_aberration = {1e-4, 0}, .doubt_of_radial = {1e-4}};
  const auto both = aberrated.then({.exponent = 0.85, .sigma_exponent = 0.01, .doubt_of_response_px = {0.03}});
  ASSERT_TRUE(both);
  EXPECT_EQ(both->sigma_aberration.blue, 1e-4);
  EXPECT_EQ(both->sigma_exponent, 0.01);
  EXPECT_NEAR(both->doubt_px(0, 400), 0.05, 1e-12);
  EXPECT_EQ(both->doubt_px(1, 400), 0);
}

// The frames between those that ask see through what those showed.
TEST(CameraDeparture, IsKeptWhileTracking) {
  const Shot& shot = usual_shot(3);
  const cv::Mat seen = seen_through({.rec709 = true}, shot);
  Tracker tracker(shot.rig);
  for (int frame = 0; frame < 30; ++frame) {
    const Observation& o = tracker.track(seen)[0];
    ASSERT_EQ(o.status, Status::ok);
    const double error_rad = std::abs(shot.psi_error_rad(o.rcm.value().q.psi_rad));
    EXPECT_LT(error_rad, 1.5e-3) << "frame " << frame;
    EXPECT_LT(error_rad, 3 * std::sqrt(o.rcm->covariance(3, 3))) << "frame " << frame;
  }
}

}  // namespace lapservo::internal::camera_departure_test
