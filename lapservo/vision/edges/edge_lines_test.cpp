#include "lapservo/vision/edges/edge_lines.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <hwy/highway.h>
#include <hwy/targets.h>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "lapservo/core/random.h"
#include "lapservo/vision/edges/test_profile.h"

namespace lapservo::internal::edge_lines_test {

using Shape = std::function<double(double)>;  // light at a distance from the edge, 0 to 1

constexpr std::array usual_floor{0.02, 0.05, 0.1}, usual_rise{0.5, 0.3, -0.06};

TestProfile profile_of(const Shape& shape, double offset_px, int reach_px, double noise = 0, std::uint64_t seed = 0) {
  Random random(seed);
  TestProfile profile{.reach = reach_px};
  for (int i = 0; i < profile.count; ++i) {
    const double here = shape(i - reach_px - offset_px);
    for (std::size_t c = 0; c < 3; ++c)
      profile.light[static_cast<std::size_t>(i)][c] =
          static_cast<float>(usual_floor[c] + usual_rise[c] * here + noise * random.normal());
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

TEST(EdgeFit, AStepIsFoundWhereItIs) {
  for (const double blur_px : {0.8, 1.2, 2.0})
    for (double edge_px = -3; edge_px <= 3; edge_px += 0.37) {
      const EdgeFit fit = profile_of(step(blur_px), edge_px, 10).fit(static_cast<float>(blur_px), 8);
      ASSERT_TRUE(fit.converged) << blur_px << ", " << edge_px;
      EXPECT_NEAR(fit.offset_px, edge_px, 0.003) << blur_px;
      for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(fit.step[c], usual_rise[c], 0.002) << blur_px;
    }
}

TEST(EdgeFit, TheErrorIsAsPredicted) {
  constexpr double noise = 0.005, blur_px = 1.2;
  constexpr int profiles = 1500;
  for (const float radius_px : {0.0F, 45.0F}) {
    const Shape shape = radius_px > 0 ? contour(blur_px, static_cast<double>(radius_px)) : step(blur_px);
    double sum = 0, squares = 0, variances = 0;
    for (std::uint64_t seed = 1; seed <= profiles; ++seed) {
      const double offset_px = Random(seed + 10000).uniform(-1, 1);
      const EdgeFit fit = profile_of(shape, offset_px, 12, noise, seed).fit(blur_px, 6, radius_px);
      ASSERT_TRUE(fit.converged) << "seed " << seed;
      const double sigmas = (fit.offset_px - offset_px) * std::sqrt(fit.information) / noise;
      sum += sigmas, squares += sigmas * sigmas, variances += fit.residual_variance;
    }
    EXPECT_NEAR(sum / profiles, 0, 0.1) << radius_px;
    EXPECT_NEAR(std::sqrt(squares / profiles), 1, 0.06) << radius_px;
    EXPECT_NEAR(std::sqrt(variances / profiles), noise, 0.03 * noise) << radius_px;
  }
}

TEST(EdgeFit, AContourIsFoundWhereItsTrueEdgeIs) {
  for (const double radius_px : {25.0, 45.0, 70.0})
    for (const double blur_px : {0.9, 1.5})
      for (const double edge_px : {-0.8, 0.0, 0.45}) {
        const TestProfile profile = profile_of(contour(blur_px, radius_px), edge_px, 8);
        const EdgeFit fit = profile.fit(static_cast<float>(blur_px), 8, static_cast<float>(radius_px));
        ASSERT_TRUE(fit.converged) << radius_px << ", " << blur_px;
        EXPECT_NEAR(fit.offset_px, edge_px, 0.03) << radius_px << ", " << blur_px;
        const EdgeFit as_step = profile.fit(static_cast<float>(blur_px), 8);
        EXPECT_GT(as_step.offset_px, edge_px + 0.3) << "the apparent edge lies inside the true one";
      }
}

// A contour's blur moves its edge, so one step to both is needed: to the blur as if the place were known leads part of
// the way.
TEST(EdgeFit, OneStepFindsTheBlur) {
  for (const double radius_px : {0.0, 14.0, 45.0})
    for (const double blur_px : {0.9, 1.2, 1.6})
      for (const double assumed_px : {0.9 * blur_px, 1.15 * blur_px}) {
        const int reach_px = radius_px > 0 ? static_cast<int>(0.34 * radius_px) : 10;
        const Shape shape = radius_px > 0 ? contour(blur_px, radius_px) : step(blur_px);
        const EdgeFit fit =
            profile_of(shape, 0, reach_px).fit(static_cast<float>(assumed_px), 8, static_cast<float>(radius_px));
        ASSERT_TRUE(fit.converged);
        EXPECT_NEAR(assumed_px + fit.blur_gradient / fit.blur_information, blur_px,
                    0.25 * std::abs(assumed_px - blur_px))
            << radius_px << ", " << assumed_px;
      }
}

// Clipped light is no measurement: whatever stands there changes nothing, and the edge stays in place. A channel of
// which too few samples are left says nothing.
TEST(EdgeFit, SaturatedSamplesAreDropped) {
  TestProfile profile = profile_of(step(1.2), 0.6, 9, 0.003, 5);
  profile.clipped_from[0] = 13;
  const EdgeFit fit = profile.fit(1.2F, 8);
  ASSERT_TRUE(fit.converged);
  EXPECT_NEAR(fit.offset_px, 0.6, 4 * 0.003 / std::sqrt(fit.information));
  for (const float clipped : {0.0F, 0.4F, 1.0F, 1e6F}) {
    profile.clipped_light = clipped;
    const EdgeFit same = profile.fit(1.2F, 8);
    EXPECT_EQ(same.offset_px, fit.offset_px) << clipped;
    EXPECT_EQ(same.residual_variance, fit.residual_variance) << clipped;
    EXPECT_EQ(same.blur_gradient, fit.blur_gradient) << clipped;
  }
  profile.clipped_from[0] = 0;
  const EdgeFit without = profile.fit(1.2F, 8);
  profile.clipped_from[0] = 6;
  const EdgeFit with_few = profile.fit(1.2F, 8);
  EXPECT_EQ(with_few.offset_px, without.offset_px);
  EXPECT_EQ(with_few.residual_variance, without.residual_variance);
  EXPECT_EQ(with_few.step[0], 0);
}

// A channel that is gone takes its information with it and nothing else.
TEST(EdgeFit, InformationAddsUpOverTheChannels) {
  const TestProfile profile = profile_of(step(1.2), 0, 9);
  float sum = 0;
  for (std::size_t only = 0; only < 3; ++only) {
    TestProfile part = profile;
    part.clipped_from.fill(0);
    part.clipped_from[only] = part.count;
    const EdgeFit fit = part.fit(1.2F, 1);
    sum += fit.information;
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(fit.step[c], c == only ? usual_rise[c] : 0, 1e-4);
  }
  EXPECT_NEAR(sum, profile.fit(1.2F, 1).information, 1e-3F * sum);
}

constexpr double edge_px = 60.3, blur_px = 1.2, radius_px = 45;

// Light that rises at edge_px from the left, with noise; and bright spots.
cv::Mat picture(bool limb, std::uint64_t seed, int spots = 0) {
  const Response response;
  const Shape shape = limb ? contour(blur_px, radius_px) : step(blur_px);
  Random random(seed);
  cv::Mat image(100, 140, CV_8UC3);
  for (int u = 0; u < image.cols; ++u)
    for (int c = 0; c < 3; ++c) {
      const double value = 255 * response.value_from_light(0.05 + (0.4 - 0.1 * c) * shape(u - edge_px));
      for (int v = 0; v < image.rows; ++v)
        image.at<cv::Vec3b>(v, u)[c] = cv::saturate_cast<std::uint8_t>(value + 1.5 * random.normal());
    }
  for (int i = 0; i < spots; ++i)
    image.at<cv::Vec3b>(static_cast<int>(random.uniform(0, image.rows)), static_cast<int>(random.uniform(50, 75))) = {
        255, 255, 255};
  return image;
}

// In all directions and lengths, across the edge; some up to the image's border.
std::vector<EdgeLine> random_lines(std::size_t count, bool contour, std::uint64_t seed) {
  Random random(seed);
  std::vector<EdgeLine> lines;
  for (std::size_t i = 0; i < count; ++i) {
    const double angle_rad = random.uniform(-0.7, 0.7), cosine = std::cos(angle_rad);
    EdgeLine line;
    line.u_px = static_cast<float>(edge_px + random.uniform(-1.5, 1.5));
    line.v_px = static_cast<float>(random.uniform(16, 83));
    line.du = static_cast<float>(cosine), line.dv = static_cast<float>(std::sin(angle_rad));
    line.before = static_cast<int>(random.uniform(4, 9));
    line.after = static_cast<int>(random.uniform(contour ? 9 : 4, contour ? 16 : 10));
    line.blur_px = static_cast<float>(random.uniform(1, 1.5) / cosine);
    if (contour) line.contour_radius_px = static_cast<float>(radius_px / cosine);
    lines.push_back(line);
  }
  return lines;
}

void expect_same(const EdgeFit& a, const EdgeFit& b) {
  ASSERT_EQ(a.converged, b.converged);
  if (!a.converged) return;
  EXPECT_NEAR(a.offset_px, b.offset_px, 2e-3);
  EXPECT_NEAR(a.information, b.information, 5e-3 * a.information);
  EXPECT_NEAR(a.residual_variance, b.residual_variance, 0.01 * a.residual_variance + 1e-9);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(a.step[c], b.step[c], 3e-3);
  EXPECT_NEAR(a.blur_gradient, b.blur_gradient, 0.03 * std::sqrt(a.blur_information * a.residual_variance) + 1e-4);
  EXPECT_NEAR(a.blur_information, b.blur_information, 0.01 * a.blur_information);
}

// Runs a check on every instruction set that this machine has and that is compiled.
template <typename Check>
void on_every_target(const Check& check) {
  const auto targets = hwy::SupportedAndGeneratedTargets();
  ASSERT_FALSE(targets.empty());
  for (const auto target : targets) {
    SCOPED_TRACE(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    check();
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

class EdgeLines : public ::testing::TestWithParam<bool> {};

TEST_P(EdgeLines, TogetherAreAsOneByOneOnEveryProcessor) {
  const auto table = Response{}.table();
  int located = 0, converged = 0;
  for (const int spots : {0, 60})
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      SCOPED_TRACE("seed " + std::to_string(seed) + ", spots " + std::to_string(spots));
      const cv::Mat image = picture(GetParam(), seed, spots);
      const ImageView view(image);
      Camera camera;
      camera.width_px = image.cols, camera.height_px = image.rows, camera.cx_px = 70, camera.cy_px = 45;
      if (seed % 2 == 0) camera.chromatic_aberration = {0.99, 1.008};
      const LightImage light(view, table, ChannelGeometry(camera));
      for (const std::size_t count : {1U, 7U, 16U, 61U})
        for (const int iterations : {1, 3}) {
          const auto lines = random_lines(count, GetParam(), seed + 100 * count);
          std::vector<EdgeFit> one_by_one;
          for (const EdgeLine& line : lines) one_by_one.push_back(locate_edges(light, {&line, 1}, iterations)[0]);
          on_every_target([&] {
            const EdgeFits fits = locate_edges(light, lines, iterations);
            ASSERT_EQ(fits.size(), count);
            for (std::size_t i = 0; i < count; ++i) {
              SCOPED_TRACE("line " + std::to_string(i));
              expect_same(one_by_one[i], fits[i]);
              ++located, converged += fits[i].converged;
            }
          });
        }
    }
  EXPECT_GT(2 * converged, located);
}

TEST_P(EdgeLines, NothingIsLocatedWhereNothingIs) {
  const auto table = Response{}.table();
  for (const int value : {90, 255}) {
    const cv::Mat flat(100, 140, CV_8UC3, cv::Scalar::all(value));
    const ImageView view(flat);
    const LightImage light(view, table);
    on_every_target([&] {
      for (const EdgeFit& fit : locate_edges(light, random_lines(20, GetParam(), 3), 3)) EXPECT_FALSE(fit.converged);
    });
  }
}

// The last sample may lie on the last pixel's threshold, and no byte behind the image is read (ASan).
TEST_P(EdgeLines, MayReachTheImagesCorner) {
  const auto table = Response{}.table();
  const cv::Mat image = picture(GetParam(), 1);
  const ImageView view(image);
  const LightImage light(view, table);
  EdgeLine line{.u_px = 118.98F, .v_px = 98.98F, .before = 8, .after = 20, .blur_px = 1.2F};
  if (GetParam()) line.contour_radius_px = 45;
  on_every_target([&] { EXPECT_EQ(locate_edges(light, {&line, 1}, 2).size(), 1); });
}

INSTANTIATE_TEST_SUITE_P(Shapes, EdgeLines, ::testing::Bool(),
                         [](const auto& chosen) { return chosen.param ? "limb" : "step"; });

}  // namespace lapservo::internal::edge_lines_test
