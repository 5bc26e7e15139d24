#include "lapservo/vision/edges/edge_lines.h"

#include <algorithm>
#include <cmath>
#include <hwy/highway.h>
#include <hwy/targets.h>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "lapservo/core/random.h"

namespace lapservo::internal {
namespace {

constexpr double edge_px = 60.3, blur_px = 1.2, radius_px = 45;

// Light that rises at edge_px from the left, as a step or as a cylinder's occluding contour, with noise; and bright
// spots.
cv::Mat picture(bool contour, std::uint64_t seed, int spots = 0) {
  const Response response;
  Random random(seed);
  cv::Mat image(100, 140, CV_8UC3);
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u)
      for (int c = 0; c < 3; ++c) {
        const double x = u - edge_px, from_axis = 1 - std::clamp(x / radius_px, 0.0, 1.0);
        const double shade = contour ? (x > 0 ? 0.25 + 0.75 * std::sqrt(1 - from_axis * from_axis) : 0)
                                     : 0.5 * std::erfc(-x / blur_px / std::sqrt(2.0));
        const double light = 0.05 + (0.4 - 0.1 * c) * shade;
        const double value = 255 * response.value_from_light(light) + 1.5 * random.normal();
        image.at<cv::Vec3b>(v, u)[c] = cv::saturate_cast<std::uint8_t>(value);
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
          on_every_target([&] {
            const EdgeFits fits = locate_edges(light, lines, iterations);
            ASSERT_EQ(fits.size(), count);
            for (std::size_t i = 0; i < count; ++i) {
              SCOPED_TRACE("line " + std::to_string(i));
              expect_same(locate_edge(light, lines[i], iterations), fits[i]);
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

}  // namespace
}  // namespace lapservo::internal
