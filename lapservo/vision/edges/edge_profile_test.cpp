#include "lapservo/vision/edges/edge_profile.h"

#include <cmath>
#include <functional>
#include <numbers>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal {
namespace {

using Shape = std::function<double(double)>;  // light at a distance from the edge, 0 to 1
using Channels = std::array<double, 3>;

const Channels usual_floor{0.02, 0.05, 0.1}, usual_rise{0.5, 0.3, -0.06};

EdgeProfile profile_of(const Shape& shape, double edge_px, int reach_px, double noise = 0, std::uint64_t seed = 0) {
  Random random(seed);
  EdgeProfile profile;
  profile.first_px = static_cast<float>(-reach_px);
  profile.count = static_cast<std::size_t>(2 * reach_px + 1);
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t i = 0; i < profile.count; ++i) {
      const double x = static_cast<double>(i) - reach_px - edge_px;
      profile.light[c][i] = static_cast<float>(usual_floor[c] + usual_rise[c] * shape(x) + noise * random.normal());
      profile.usable[c][i] = true;
    }
  return profile;
}

Shape step(double blur_px) {
  return [blur_px](double x) { return 0.5 * std::erfc(-x / blur_px / std::numbers::sqrt2); };
}

// Ambient plus diffuse light of a cylinder, blurred by numeric convolution.
Shape contour(double blur_px, double radius_px) {
  return [=](double x) {
    constexpr int count = 800;
    double sum = 0;
    for (int i = 0; i < count; ++i) {
      const double t = 6 * (2 * (i + 0.5) / count - 1), at = (x - t * blur_px) / radius_px;
      const double shade = at <= 0 ? 0 : 0.25 + 0.75 * std::sqrt(std::max(0.0, 1 - (1 - at) * (1 - at)));
      sum += shade * std::exp(-t * t / 2) * 12 / count;
    }
    return sum / std::sqrt(2 * pi);
  };
}

TEST(EdgeProfile, AStepIsFoundWhereItIs) {
  for (const double blur_px : {0.8, 1.2, 2.0})
    for (double edge_px = -3; edge_px <= 3; edge_px += 0.37) {
      const EdgeFit fit = fit_step(profile_of(step(blur_px), edge_px, 10), static_cast<float>(blur_px), 8);
      ASSERT_TRUE(fit.converged) << blur_px << ", " << edge_px;
      EXPECT_NEAR(fit.offset_px, edge_px, 0.003) << blur_px;
      for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(fit.step[c], usual_rise[c], 0.002) << blur_px;
    }
}

TEST(EdgeProfile, TheErrorOfAStepIsAsPredicted) {
  constexpr double noise = 0.01, blur_px = 1.2;
  constexpr int profiles = 1500;
  double sum = 0, squares = 0, variances = 0;
  for (std::uint64_t seed = 1; seed <= profiles; ++seed) {
    const double edge_px = Random(seed + 10000).uniform(-1, 1);
    const EdgeFit fit = fit_step(profile_of(step(blur_px), edge_px, 8, noise, seed), blur_px, 6);
    ASSERT_TRUE(fit.converged) << "seed " << seed;
    const double sigmas = (fit.offset_px - edge_px) * std::sqrt(fit.information) / noise;
    sum += sigmas, squares += sigmas * sigmas, variances += fit.residual_variance;
  }
  EXPECT_NEAR(sum / profiles, 0, 0.1);
  EXPECT_NEAR(std::sqrt(squares / profiles), 1, 0.06);
  EXPECT_NEAR(std::sqrt(variances / profiles), noise, 0.03 * noise);
}

TEST(EdgeProfile, AContourIsFoundWhereItsTrueEdgeIs) {
  for (const double radius_px : {25.0, 45.0, 70.0})
    for (const double blur_px : {0.9, 1.5})
      for (const double edge_px : {-0.8, 0.0, 0.45}) {
        EdgeProfile profile = profile_of(contour(blur_px, radius_px), edge_px, 8);
        const EdgeFit fit = fit_contour(profile, static_cast<float>(blur_px), static_cast<float>(radius_px), 8);
        ASSERT_TRUE(fit.converged) << radius_px << ", " << blur_px;
        EXPECT_NEAR(fit.offset_px, edge_px, 0.03) << radius_px << ", " << blur_px;
        const EdgeFit as_step = fit_step(profile, static_cast<float>(blur_px), 8);
        EXPECT_GT(as_step.offset_px, edge_px + 0.3) << "the apparent edge lies inside the true one";
      }
}

TEST(EdgeProfile, TheErrorOfAContourIsAsPredicted) {
  constexpr double noise = 0.005, blur_px = 1.2, radius_px = 45;
  constexpr int profiles = 400;
  const Shape shape = contour(blur_px, radius_px);
  double squares = 0;
  for (std::uint64_t seed = 1; seed <= profiles; ++seed) {
    const EdgeFit fit = fit_contour(profile_of(shape, 0.2, 12, noise, seed), blur_px, radius_px, 6);
    ASSERT_TRUE(fit.converged) << "seed " << seed;
    const double sigmas = (fit.offset_px - 0.2) * std::sqrt(fit.information) / noise;
    squares += sigmas * sigmas;
  }
  EXPECT_NEAR(std::sqrt(squares / profiles), 1, 0.12);
}

// A contour's blur moves its edge, so one step to both is needed: to the blur as if the place were known leads part of
// the way.
TEST(EdgeProfile, OneStepFindsTheBlurOfAContour) {
  constexpr double blur_px = 1.0;
  for (const double radius_px : {14.0, 45.0})
    for (const double assumed_px : {0.9, 1.15}) {
      const int reach_px = static_cast<int>(0.34 * radius_px);
      const EdgeFit fit = fit_contour(profile_of(contour(blur_px, radius_px), 0, reach_px),
                                      static_cast<float>(assumed_px), static_cast<float>(radius_px), 8);
      ASSERT_TRUE(fit.converged);
      EXPECT_NEAR(assumed_px + fit.blur_gradient / fit.blur_information, blur_px, 0.25 * std::abs(assumed_px - blur_px))
          << radius_px << ", " << assumed_px;
    }
}

// Clipped light is no measurement: whatever stands there changes nothing, and the edge stays in place.
TEST(EdgeProfile, SaturatedSamplesAreDropped) {
  EdgeProfile profile = profile_of(step(1.2), 0.6, 9, 0.003, 5);
  for (std::size_t i = 12; i < profile.count; ++i) profile.usable[0][i] = false;
  const EdgeFit fit = fit_step(profile, 1.2F, 8);
  ASSERT_TRUE(fit.converged);
  EXPECT_NEAR(fit.offset_px, 0.6, 4 * 0.003 / std::sqrt(fit.information));
  for (const float clipped : {0.0F, 0.4F, 1.0F, 1e6F}) {
    for (std::size_t i = 12; i < profile.count; ++i) profile.light[0][i] = clipped;
    const EdgeFit same = fit_step(profile, 1.2F, 8);
    EXPECT_EQ(same.offset_px, fit.offset_px) << clipped;
    EXPECT_EQ(same.residual_variance, fit.residual_variance) << clipped;
    EXPECT_EQ(same.blur_gradient, fit.blur_gradient) << clipped;
  }
  for (auto& channel : profile.usable) channel.fill(false);
  EXPECT_FALSE(fit_step(profile, 1.2F, 8).converged);
}

// A channel that is gone takes its information with it and nothing else.
TEST(EdgeProfile, InformationAddsUpOverTheChannels) {
  const EdgeProfile profile = profile_of(step(1.2), 0, 9);
  float sum = 0;
  for (std::size_t only = 0; only < 3; ++only) {
    EdgeProfile part = profile;
    for (std::size_t c = 0; c < 3; ++c)
      if (c != only) part.usable[c].fill(false);
    sum += fit_step(part, 1.2F, 1).information;
  }
  EXPECT_NEAR(sum, fit_step(profile, 1.2F, 1).information, 1e-3F * sum);
}

TEST(EdgeProfile, BlurEvidencePointsToTheTrueBlur) {
  for (const double true_px : {0.9, 1.1, 1.3, 1.6}) {
    const EdgeProfile profile = profile_of(step(true_px), 0.2, 10);
    const EdgeProfile of_contour = profile_of(contour(true_px, 45), 0.1, 12);
    float blur_px = 1.2F, contour_blur_px = 1.2F;
    for (int i = 0; i < 6; ++i) {
      const EdgeFit fit = fit_step(profile, blur_px, 8), contour_fit = fit_contour(of_contour, contour_blur_px, 45, 8);
      blur_px += fit.blur_gradient / fit.blur_information;
      contour_blur_px += contour_fit.blur_gradient / contour_fit.blur_information;
    }
    EXPECT_NEAR(blur_px, true_px, 0.02);
    EXPECT_NEAR(contour_blur_px, true_px, 0.1);
  }
}

TEST(EdgeProfile, WhatIsNoEdgeIsNotOne) {
  EdgeProfile flat = profile_of([](double) { return 0.5; }, 0, 9);
  EXPECT_FALSE(fit_step(flat, 1.2F, 5).converged);
  const EdgeProfile far_away = profile_of(step(1.2), 14, 9);
  const EdgeFit fit = fit_step(far_away, 1.2F, 8);
  EXPECT_TRUE(!fit.converged || fit.information < 1e-3F);
  EXPECT_TRUE(std::isfinite(fit.offset_px));
}

}  // namespace
}  // namespace lapservo::internal
