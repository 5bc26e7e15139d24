#include "lapservo/vision/camera_departure.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/median.h"
#include "lapservo/testing/camera_effects.h"
#include "lapservo/testing/scenes.h"
#include "lapservo/vision/fine_fit.h"

namespace lapservo::internal {
namespace {

using effects::CameraEffects;
using scenes::Shot;
using scenes::Sight;
using scenes::usual_shot;

constexpr std::uint64_t frames = 12;

CameraEffects aberrated(const ChromaticAberration& aberration) {
  CameraEffects camera;
  camera.aberration = aberration;
  return camera;
}

CameraEffects rec709() {
  CameraEffects camera;
  camera.rec709 = true;
  return camera;
}

FineFit fit_to(const Shot& shot, const cv::Mat& bgr, const ExpectedProcessing& expected = {}) {
  const Sight sight(shot.rig, bgr);
  return fit_finely(sight.scene(), sight.light(), shot.truth(true), {}, expected);
}

double psi_error_rad(const Shot& shot, const FineFit& fit) {
  return std::abs(wrap_pi(fit.unknowns.q().value().psi_rad - shot.q.psi_rad));
}

// psi of frames through a camera that the rig does not know, beside that of fits that do not ask.
struct Errors {
  std::vector<double> asked_rad, unasked_rad, sigmas;

  void add(const Shot& shot, const cv::Mat& seen, const FineFit& fit) {
    const Eigen::Index psi = fit.unknowns.size() - 1;
    asked_rad.push_back(psi_error_rad(shot, fit));
    sigmas.push_back(asked_rad.back() / std::sqrt(fit.covariance(psi, psi)));
    unasked_rad.push_back(psi_error_rad(shot, fit_to(shot, seen, {.ask = false})));
  }
};

TEST(CameraDeparture, MagnificationsThatTheRigDoesNotKnowAreFound) {
  constexpr ChromaticAberration aberration{1.0015, 0.9985};
  Errors errors;
  for (std::uint64_t seed = 1; seed <= frames; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Shot& shot = usual_shot(seed);
    const cv::Mat seen = effects::seen_through(aberrated(aberration), shot.bgr, shot.rig.camera);
    const FineFit fit = fit_to(shot, seen);
    ASSERT_TRUE(fit.converged);
    errors.add(shot, seen, fit);
    const CameraDeparture& found = fit.departure;
    EXPECT_EQ(found.exponent, 1);
    if (found.aberration == ChromaticAberration{}) continue;  // near the middle of the picture there is none
    EXPECT_LT(std::abs(found.aberration.blue - aberration.blue), 3 * found.sigma_aberration.blue);
    EXPECT_LT(std::abs(found.aberration.red - aberration.red), 3 * found.sigma_aberration.red);
  }
  EXPECT_LT(median(errors.asked_rad), 0.3 * median(errors.unasked_rad));
  EXPECT_LT(*std::max_element(errors.sigmas.begin(), errors.sigmas.end()), 3);
}

// Rec. 709's light is sRGB's to the power of 0.85 to 0.89.
TEST(CameraDeparture, AResponseThatIsNotTheRigsIsFound) {
  Errors errors;
  std::uint64_t found = 0;
  for (std::uint64_t seed = 1; seed <= frames; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Shot& shot = usual_shot(seed);
    const cv::Mat seen = effects::seen_through(rec709(), shot.bgr, shot.rig.camera);
    const FineFit fit = fit_to(shot, seen);
    ASSERT_TRUE(fit.converged);
    EXPECT_EQ(fit.departure.aberration, ChromaticAberration{});
    errors.add(shot, seen, fit);
    if (fit.departure.exponent == 1) continue;  // too little of it shows
    ++found;
    EXPECT_NEAR(fit.departure.exponent, 0.87, 3 * fit.departure.sigma_exponent);
  }
  EXPECT_GE(4 * found, 3 * frames);
  EXPECT_LT(median(errors.asked_rad), 0.5 * median(errors.unasked_rad));
  EXPECT_LT(*std::max_element(errors.sigmas.begin(), errors.sigmas.end()), 3);
}

// Nor does what a camera does beyond its response look like one.
TEST(CameraDeparture, CamerasAsTheRigSaysShowNone) {
  for (std::uint64_t seed = 1; seed <= frames; ++seed) {
    const Shot& shot = usual_shot(seed);
    EXPECT_FALSE(fit_to(shot, shot.bgr).departure.any()) << "seed " << seed;
    for (const char* condition : {"bayer", "vignette", "crosstalk", "chroma420"}) {
      const cv::Mat seen = effects::seen_through(effects::draw(condition, seed), shot.bgr, shot.rig.camera);
      EXPECT_FALSE(fit_to(shot, seen).departure.any()) << condition << ", seed " << seed;
    }
  }
}

TEST(CameraDeparture, IsKeptByFramesThatAreNotAsked) {
  const Shot& shot = usual_shot(3);
  const cv::Mat seen = effects::seen_through(aberrated({1.0015, 0.9985}), shot.bgr, shot.rig.camera);
  const FineFit first = fit_to(shot, seen);
  ASSERT_TRUE(first.departure.any());
  const FineFit next = fit_to(shot, seen, {.ask = false, .departure = first.departure});
  EXPECT_EQ(next.departure.aberration, first.departure.aberration);
  EXPECT_NEAR(next.unknowns.q().value().psi_rad, first.unknowns.q().value().psi_rad, 3e-4);
  const FineFit again = fit_to(shot, seen, {.ask = true, .departure = first.departure});
  EXPECT_NEAR(again.departure.aberration.blue, first.departure.aberration.blue, 3e-4);
}

// What is undone twice is undone by both.
TEST(CameraDeparture, OneAfterAnotherIsBoth) {
  const CameraDeparture first{.aberration = {1.001, 0.999}, .exponent = 0.9},
      more{.aberration = {1.002, 1}, .exponent = 1.1};
  const CameraDeparture both = first.then(more);
  const Shot& shot = usual_shot(1);
  const DepartedLight by_first(shot.sight.light(), first), by_more(by_first.light(), more);
  const DepartedLight by_both(shot.sight.light(), both);
  for (const float u : {100.0F, 333.3F, 700.7F})
    for (std::size_t c = 0; c < 3; ++c)
      EXPECT_NEAR(by_more.light().at(u, 250).light[c], by_both.light().at(u, 250).light[c], 1e-5);
}

}  // namespace
}  // namespace lapservo::internal
