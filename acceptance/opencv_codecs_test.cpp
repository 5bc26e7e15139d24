// Compares images with OpenCV's codecs, which share nothing with ours but libjpeg and libpng.
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "lapservo/core/random.h"
#include "lapservo/io/image_file.h"
#include "lapservo/testing/input_error.h"

namespace lapservo::internal::opencv_codecs_test {
using Bytes = std::vector<std::uint8_t>;

constexpr std::uint64_t seed = 61;

// Shades with noise, odd in size.
cv::Mat picture_of(int type, Random& random) {
  cv::Mat image(87, 131, type);
  const double scale = image.depth() == CV_16U ? 257 : 1;
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u)
      for (int c = 0; c < image.channels(); ++c) {
        const double value = scale * (80 + 60 * std::sin(0.05 * u + c) * std::cos(0.07 * v) + 6 * random.normal());
        const int at = u * image.channels() + c;
        if (image.depth() == CV_16U)
          image.ptr<std::uint16_t>(v)[at] = cv::saturate_cast<std::uint16_t>(value);
        else
          image.ptr<std::uint8_t>(v)[at] = cv::saturate_cast<std::uint8_t>(value);
      }
  return image;
}

Bytes opencv_encode(const std::string& extension, const cv::Mat& image, const std::vector<int>& options = {}) {
  Bytes bytes;
  EXPECT_TRUE(cv::imencode(extension, image, bytes, options)) << extension;
  return bytes;
}

// As image_file.h has it.
cv::Mat opencv_decode(const Bytes& bytes) {
  return bgr8_from(cv::imdecode(bytes, cv::IMREAD_UNCHANGED), "p");
}

double largest_difference(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() ? cv::norm(a, b, cv::NORM_INF) : 1e9;
}

TEST(Decoding, GivesThePixelsOfOpenCv) {
  Random random(seed);
  struct Case {
    std::string extension;
    std::vector<int> types, options;
  };
  const std::vector<int> eight{CV_8UC1, CV_8UC3}, all{CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1, CV_16UC3, CV_16UC4};
  for (const Case& one : {Case{".jpg", eight, {}}, Case{".png", all, {}}, Case{".bmp", {CV_8UC1, CV_8UC3, CV_8UC4}, {}},
                          Case{".webp", {CV_8UC3, CV_8UC4}, {}}, Case{".ppm", {CV_8UC3, CV_16UC3}, {}},
                          Case{".ppm", {CV_8UC3}, {cv::IMWRITE_PXM_BINARY, 0}}, Case{".pgm", {CV_8UC1, CV_16UC1}, {}},
                          Case{".pgm", {CV_8UC1}, {cv::IMWRITE_PXM_BINARY, 0}}})
    for (const int type : one.types) {
      const Bytes bytes = opencv_encode(one.extension, picture_of(type, random), one.options);
      const std::string name = one.extension + " " + cv::typeToString(type);
      EXPECT_EQ(largest_difference(decode_image(bytes, name), opencv_decode(bytes)), 0) << name;
    }
}

// Where files are cut they are refused too, or nothing of the image was lost.
TEST(Decoding, RefusesAFileWhereverItIsCut) {
  Random random(seed);
  const cv::Mat image = picture_of(CV_8UC3, random)(cv::Rect(0, 0, 13, 12)).clone();
  for (const std::string extension : {".bmp", ".webp", ".ppm"}) {
    const Bytes whole = opencv_encode(extension, image);
    for (std::size_t size = 1; size < whole.size(); ++size) {
      const auto cut = std::span(whole).first(size);
      if (!testing::input_error([&] { decode_image(cut, "p"); }).empty()) continue;
      EXPECT_EQ(largest_difference(decode_image(cut, "p"), image), 0)
          << extension << " " << size << " of " << whole.size() << " bytes";
    }
  }
}

// Four pixels share their colour differences, which FFmpeg spreads in another way than libwebp, as near to the
// original.
TEST(Decoding, OfWebPWithLossIsAsNearToTheOriginalAsOpenCvs) {
  Random random(seed);
  for (const int type : {CV_8UC3, CV_8UC4}) {
    const cv::Mat image = picture_of(type, random), original = bgr8_from(image, "p");
    const Bytes bytes = opencv_encode(".webp", image, {cv::IMWRITE_WEBP_QUALITY, 90});
    const cv::Mat ours = decode_image(bytes, "p"), opencvs = opencv_decode(bytes);
    EXPECT_LE(cv::norm(ours, original), 1.05 * cv::norm(opencvs, original)) << type;
    const cv::Scalar shift = cv::mean(ours) - cv::mean(opencvs);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(shift[c], 0, 0.2) << type << " " << c;
  }
}

}  // namespace lapservo::internal::opencv_codecs_test
