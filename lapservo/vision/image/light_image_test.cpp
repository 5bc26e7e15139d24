#include "lapservo/vision/image/light_image.h"

#include <cmath>
#include <utility>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::light_image_test {

cv::Mat random_image(std::uint64_t seed, int width_px, int height_px, int highest) {
  Random random(seed);
  cv::Mat image(height_px, width_px, CV_8UC3);
  for (int v = 0; v < height_px; ++v)
    for (int u = 0; u < width_px; ++u)
      for (int c = 0; c < 3; ++c)
        image.at<cv::Vec3b>(v, u)[c] = static_cast<std::uint8_t>(random.uniform(0, highest + 1));
  return image;
}

// Light is averaged, not the values that encode it.
TEST(LightImage, InterpolatesLightBetweenPixelCentres) {
  const cv::Mat image = random_image(1, 20, 15, 255);
  const ImageView view(image);
  const auto table = Response{}.table();
  const LightImage light(view, table);
  Random random(2);
  for (int i = 0; i < 2000; ++i) {
    const double u = random.uniform(0, 19), v = random.uniform(0, 14);
    const auto sample = light.at(static_cast<float>(u), static_cast<float>(v));
    for (int c = 0; c < 3; ++c) {
      double expected = 0;
      for (int q = 0; q < 15; ++q)
        for (int p = 0; p < 20; ++p)
          expected += std::max(0.0, 1 - std::abs(u - p)) * std::max(0.0, 1 - std::abs(v - q)) *
                      Response{}.light_from_value(image.at<cv::Vec3b>(q, p)[c] / 255.0);
      EXPECT_NEAR(sample.light[static_cast<std::size_t>(c)], expected, 1e-5) << "seed 2, at " << u << ", " << v;
    }
  }
}

TEST(LightImage, ReadsEachChannelWhereItsImageLies) {
  const cv::Mat image = random_image(5, 60, 50, 255);
  const ImageView view(image);
  const auto table = Response{}.table();
  const Camera camera{
      .width_px = 60, .height_px = 50, .cx_px = 31, .cy_px = 22, .response = {}, .chromatic_aberration = {0.985, 1.01}};
  const LightImage plain(view, table), light(view, table, ChannelGeometry(camera));
  Random random(6);
  int tried = 0;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector2d green(random.uniform(0, 59), random.uniform(0, 49)), centre(camera.cx_px, camera.cy_px);
    if (!light.contains(green)) continue;
    ++tried;
    const auto sample = light.at(static_cast<float>(green.x()), static_cast<float>(green.y()));
    for (const auto& [c, magnification] : {std::pair(0U, 0.985), std::pair(1U, 1.0), std::pair(2U, 1.01)}) {
      const Eigen::Vector2d place = centre + magnification * (green - centre);
      ASSERT_TRUE(plain.contains(place));
      EXPECT_NEAR(sample.light[c], plain.at(static_cast<float>(place.x()), static_cast<float>(place.y())).light[c],
                  1e-4);
    }
  }
  EXPECT_GT(tried, 1500);
}

TEST(LightImage, IsSaturatedWhereverASaturatedPixelHasAShare) {
  cv::Mat image(9, 9, CV_8UC3, cv::Scalar(100, 100, 100));
  image.at<cv::Vec3b>(4, 4) = {LightImage::saturated_value, 100, LightImage::saturated_value - 1};
  const ImageView view(image);
  const auto table = Response{}.table();
  const LightImage light(view, table);
  for (float u = 0.05F; u < 8; u += 0.1F)
    for (float v = 0.05F; v < 8; v += 0.1F) {
      const auto sample = light.at(u, v);
      EXPECT_EQ(sample.saturated[0], std::abs(u - 4) < 1 && std::abs(v - 4) < 1) << u << ", " << v;
      EXPECT_FALSE(sample.saturated[1] || sample.saturated[2]) << u << ", " << v;
    }
}

// A part of a larger image that is saturated all around: where contains() says yes, nothing of that is read. Also for
// places so near the border that they round onto it.
TEST(LightImage, ReadsNothingOutsideOfWhatItContains) {
  for (const int width_px : {16, 641, 1921}) {
    cv::Mat large(24, width_px + 4, CV_8UC3, cv::Scalar::all(255));
    cv::Mat part = large(cv::Rect(2, 2, width_px, 20));
    part.setTo(cv::Scalar::all(50));
    const ImageView view(part);
    const auto table = Response{}.table();
    const LightImage light(view, table);
    const auto check = [&](double u, double v) {
      if (!light.contains({u, v})) return false;
      const auto sample = light.at(static_cast<float>(u), static_cast<float>(v));
      EXPECT_FALSE(sample.saturated[0]) << u << ", " << v << " of " << width_px;
      return true;
    };
    for (const double inside : {1e-12, 1e-9, 1e-6, 1e-4, 1e-2, 0.5}) {
      check(width_px - 1 - inside, 5);
      check(5, 19 - inside);
      check(width_px - 1 - inside, 19 - inside);
      EXPECT_TRUE(check(inside, inside));
    }
    EXPECT_TRUE(check(width_px - 1.1, 18.9));
    for (const double beyond : {0.0, 0.5, 3.0}) {
      EXPECT_FALSE(light.contains({width_px - 1 + beyond, 5}));
      EXPECT_FALSE(light.contains({5, 19 + beyond}));
    }
    EXPECT_FALSE(light.contains({-0.1, 5}));
    EXPECT_FALSE(light.contains({5, -0.1}));
    EXPECT_FALSE(light.contains({std::nan(""), 5}));
  }
}

}  // namespace lapservo::internal::light_image_test
