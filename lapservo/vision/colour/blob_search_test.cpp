#include "lapservo/vision/colour/blob_search.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include <gtest/gtest.h>

#include "lapservo/sim/renderer.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal::blob_search_test {

constexpr int width_px = 640, height_px = 480;

ColourClasses usual_classes() {
  Instrument instrument;
  instrument.marker.hues_deg = {90, 180, 270};
  return ColourClasses({instrument});
}

const std::array<cv::Vec3b, 3> band_bgr{cv::Vec3b(20, 200, 110), cv::Vec3b(200, 200, 20), cv::Vec3b(200, 20, 110)};
const cv::Scalar flesh(60, 70, 160);

// A marker lying flat: three bands along a strip.
struct Strip {
  Eigen::Vector2d centre_px;
  double turn_rad, length_px, width_px;

  // Position along, 0 to 1; outside the strip nothing.
  std::optional<double> along(double u, double v) const {
    const Eigen::Vector2d offset = Eigen::Vector2d(u, v) - centre_px, axis(std::cos(turn_rad), std::sin(turn_rad));
    const double x = offset.dot(axis), y = offset.x() * axis.y() - offset.y() * axis.x();
    if (std::abs(x) >= length_px / 2 || std::abs(y) >= width_px / 2) return std::nullopt;
    return x / length_px + 0.5;
  }
  // In its bands' colours, or in another.
  void paint(cv::Mat& image, std::optional<cv::Vec3b> bgr = std::nullopt) const {
    for (int v = 0; v < image.rows; ++v)
      for (int u = 0; u < image.cols; ++u)
        if (const auto x = along(u, v))
          image.at<cv::Vec3b>(v, u) = bgr.value_or(band_bgr[static_cast<std::size_t>(3 * *x)]);
  }
};

cv::Mat blank() {
  return {height_px, width_px, CV_8UC3, flesh};
}

std::vector<Blob> search(const cv::Mat& image) {
  return largest_blobs(ImageView(image), usual_classes());
}

TEST(BlobSearch, FindsAMarkerWhereverItLiesAndHoweverItIsTurned) {
  const ColourClasses classes = usual_classes();
  for (std::uint64_t seed = 1; seed <= 25; ++seed) {
    testing::SeededRandom random(seed);
    const Strip strip{{random.uniform(130, width_px - 130), random.uniform(130, height_px - 130)},
                      random.uniform(-pi, pi),
                      random.uniform(110, 240),
                      random.uniform(40, 80)};
    cv::Mat image = blank();
    strip.paint(image);
    const auto blobs = search(image);
    ASSERT_EQ(blobs.size(), 1U);
    std::size_t expected = 0;
    for (int v = blob_grid_px / 2; v < height_px; v += blob_grid_px)
      for (int u = blob_grid_px / 2; u < width_px; u += blob_grid_px) expected += strip.along(u, v).has_value();
    EXPECT_GE(blobs[0].samples.size(), 0.93 * static_cast<double>(expected));
    for (const Blob::Sample& sample : blobs[0].samples) {
      const auto x = strip.along(sample.u, sample.v);
      ASSERT_TRUE(x);
      EXPECT_EQ(sample.colour, classes.of_bands(0)[static_cast<std::size_t>(3 * *x)]);
    }
  }
}

TEST(BlobSearch, SeparatesMarkersLargestFirstAndCountsNoSampleTwice) {
  cv::Mat image = blank();
  const Strip small{{150, 120}, 0.4, 110, 45}, large{{430, 330}, -0.9, 220, 70};
  small.paint(image);
  large.paint(image);
  const auto blobs = search(image);
  ASSERT_EQ(blobs.size(), 2U);
  std::set<std::pair<int, int>> seen;
  for (std::size_t b = 0; b < 2; ++b)
    for (const Blob::Sample& sample : blobs[b].samples) {
      EXPECT_TRUE((b == 0 ? large : small).along(sample.u, sample.v));
      EXPECT_TRUE(seen.emplace(sample.u, sample.v).second);
    }
}

TEST(BlobSearch, LooksAtTwoColoursBeforeLargerPatchesOfOne) {
  cv::Mat image = blank();
  for (int i = 0; i < 8; ++i)
    image(cv::Rect(8 + 160 * (i % 4), 8 + 120 * (i / 4), 110, 80))
        .setTo(cv::Scalar(band_bgr[static_cast<std::size_t>(i % 3)]));
  const Strip marker{{320, 380}, 0.2, 100, 40};
  marker.paint(image);
  const auto blobs = search(image);
  for (const Blob::Sample& sample : blobs.at(0).samples) EXPECT_TRUE(marker.along(sample.u, sample.v));
}

TEST(BlobSearch, JoinsWhatBloodPartedAndNothingElse) {
  cv::Mat image = blank();
  const Strip marker{{200, 200}, 0.6, 220, 70}, blood{{200, 200}, 0.6, 50, 80}, another{{540, 400}, -0.9, 110, 45};
  marker.paint(image);
  another.paint(image);
  blood.paint(image, cv::Vec3b(20, 20, 90));
  const auto parts = search(image);
  ASSERT_EQ(parts.size(), 3U);
  const auto joined = joined_blobs(parts);
  ASSERT_EQ(joined.size(), 2U);
  std::size_t samples = 0;
  for (const Blob& part : parts) samples += part.samples.size();
  EXPECT_EQ(joined[0].samples.size() + joined[1].samples.size(), samples);
  for (const Blob& blob : joined)
    for (const Blob::Sample& sample : blob.samples)
      EXPECT_EQ(marker.along(sample.u, sample.v).has_value(), blob.samples.size() > samples / 2);
}

TEST(BlobSearch, BridgesAHighlightAlongTheShaft) {
  cv::Mat image = blank();
  const Strip marker{{320, 240}, 0.7, 220, 70}, highlight{{320, 240}, 0.7, 240, 8};
  marker.paint(image);
  highlight.paint(image, cv::Vec3b::all(255));
  EXPECT_EQ(search(image).size(), 1U);
}

TEST(BlobSearch, FindsNothingInColouredNoiseAndInTissue) {
  Random random(7);
  cv::Mat image = blank();
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u)
      if (random.uniform() < 0.1) image.at<cv::Vec3b>(v, u) = band_bgr[random.bits() % 3];
  EXPECT_TRUE(search(image).empty()) << "seed 7";
  const Camera camera{width_px, height_px, 550, 550, 319.5, 239.5, {}, {}};
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    Renderer renderer(camera, {}, make_tissue(width_px, height_px, seed));
    EXPECT_TRUE(search(renderer.render({}, seed)).empty()) << "seed " << seed;
  }
}

// A borrowed part of a larger image: rows are not contiguous.
TEST(BlobSearch, LooksAtTheGivenPartOnly) {
  cv::Mat image = blank();
  Strip{{300, 240}, 0.3, 200, 60}.paint(image);
  const cv::Mat part = image(cv::Rect(96, 80, 400, 320));
  const auto in_part = search(part), in_copy = search(part.clone());
  ASSERT_EQ(in_part.size(), 1U);
  EXPECT_TRUE(std::ranges::equal(in_part[0].samples, in_copy.at(0).samples,
                                 [](const auto& a, const auto& b) { return a.u == b.u && a.v == b.v; }));
}

}  // namespace lapservo::internal::blob_search_test
