#include "lapservo/crtk/image_decoder.h"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/core/random.h"
#include "lapservo/io/pictures/png_encoding.h"

namespace lapservo::internal {
namespace {

// 4 x 2 pixels, padded rows.
ImageMessage message_of(const std::string& encoding, std::uint32_t bytes_a_pixel, std::uint32_t padding = 3) {
  ImageMessage message;
  message.width = 4;
  message.height = 2;
  message.step = 4 * bytes_a_pixel + padding;
  message.encoding = encoding;
  for (std::size_t i = 0; i < std::size_t{message.step} * 2; ++i)
    message.data.push_back(static_cast<std::uint8_t>(i * 7 + 3));
  return message;
}

cv::Vec3b bgr_at(const DecodedImage& image, int row, int column) {
  return std::get<cv::Mat>(image).at<cv::Vec3b>(row, column);
}
std::string why(const DecodedImage& image) {
  return std::holds_alternative<BadImage>(image) ? std::get<BadImage>(image).why : "";
}

TEST(ImageDecoder, ChannelsStepAndByteOrder) {
  const auto byte = [](const ImageMessage& m, std::size_t row, std::size_t at) { return m.data[row * m.step + at]; };
  const ImageMessage bgr = message_of("bgr8", 3), rgb = message_of("rgb8", 3), rgba = message_of("rgba8", 4);
  EXPECT_EQ(bgr_at(decode(bgr), 1, 2), cv::Vec3b(byte(bgr, 1, 6), byte(bgr, 1, 7), byte(bgr, 1, 8)));
  EXPECT_EQ(bgr_at(decode(rgb), 1, 2), cv::Vec3b(byte(rgb, 1, 8), byte(rgb, 1, 7), byte(rgb, 1, 6)));
  EXPECT_EQ(bgr_at(decode(rgba), 1, 2), cv::Vec3b(byte(rgba, 1, 10), byte(rgba, 1, 9), byte(rgba, 1, 8)));
  ImageMessage deep = message_of("rgb16", 6, 4);
  EXPECT_EQ(bgr_at(decode(deep), 1, 2), cv::Vec3b(byte(deep, 1, 17), byte(deep, 1, 15), byte(deep, 1, 13)));
  deep.is_bigendian = true;
  EXPECT_EQ(bgr_at(decode(deep), 1, 2), cv::Vec3b(byte(deep, 1, 16), byte(deep, 1, 14), byte(deep, 1, 12)));
}

TEST(ImageDecoder, ADecodedImageIsItsOwn) {
  ImageMessage message = message_of("bgr8", 3);
  const DecodedImage image = decode(message);
  const cv::Vec3b before = bgr_at(image, 0, 0);
  message.data.assign(message.data.size(), 0);
  EXPECT_EQ(bgr_at(image, 0, 0), before);
}

// UYVY and YUYV by the equations of BT.601 with its limited range.
TEST(ImageDecoder, Yuv422) {
  ImageMessage uyvy = message_of("yuv422", 2, 2), yuy2 = message_of("yuv422_yuy2", 2, 2);
  for (int row = 0; row < 2; ++row)
    for (int pair = 0; pair < 2; ++pair) {
      std::uint8_t* const a = &uyvy.data[row * uyvy.step + 4 * pair];
      std::uint8_t* const b = &yuy2.data[row * yuy2.step + 4 * pair];
      a[0] = b[1] = 90, a[1] = b[0] = 100, a[2] = b[3] = 170, a[3] = b[2] = 120;
    }
  const double y = 1.164 * (100 - 16);
  const cv::Vec3d expected(y + 2.017 * (90 - 128), y - 0.392 * (90 - 128) - 0.813 * (170 - 128),
                           y + 1.596 * (170 - 128));
  for (const ImageMessage& message : {uyvy, yuy2})
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(bgr_at(decode(message), 1, 2)[i], expected[i], 2) << message.encoding;
}

// Chroma is a slope, and its samples lie on the even columns.
TEST(ImageDecoder, ChromaOfYuv422IsInterpolatedFromTheLeftOfEachTwoPixels) {
  constexpr int columns = 24, slope = 4, middle = 128;
  for (const bool chroma_first : {true, false}) {
    ImageMessage message;
    message.width = columns, message.height = 2, message.step = 2 * columns;
    message.encoding = chroma_first ? "uyvy" : "yuyv";
    for (int i = 0; i < columns * 2; ++i) {
      const int u = middle + slope * (i % columns / 2 * 2 - columns / 2);
      const auto chroma = static_cast<std::uint8_t>(i % 2 == 0 ? u : middle), light = std::uint8_t{120};
      message.data.push_back(chroma_first ? chroma : light);
      message.data.push_back(chroma_first ? light : chroma);
    }
    for (int column = 4; column < columns - 4; ++column)
      EXPECT_NEAR(bgr_at(decode(message), 1, column)[0], 1.164 * (120 - 16) + 2.017 * slope * (column - columns / 2), 2)
          << message.encoding << ", column " << column;
  }
}

// An evenly coloured scene through each pattern: the first row's first two letters are its first two pixels.
TEST(ImageDecoder, BayerPatternsByTheirLetters) {
  const cv::Vec3b colour(40, 120, 220);
  for (const std::string pattern : {"rggb", "bggr", "gbrg", "grbg"})
    for (const bool deep : {false, true}) {
      ImageMessage message;
      message.width = 12, message.height = 10;
      message.step = deep ? 24 : 12;
      message.encoding = "bayer_" + pattern + (deep ? "16" : "8");
      for (int v = 0; v < 10; ++v)
        for (int u = 0; u < 12; ++u) {
          const char letter = pattern[2 * (v % 2) + u % 2];
          if (deep) message.data.push_back(99);
          message.data.push_back(letter == 'b' ? colour[0] : letter == 'g' ? colour[1] : colour[2]);
        }
      const cv::Vec3b got = bgr_at(decode(message), 5, 6);
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(got[i], colour[i], 2) << message.encoding;
    }
}

TEST(ImageDecoder, RefusesWithTheReason) {
  EXPECT_NE(why(decode(message_of("mono8", 1))).find("has no colours"), std::string::npos);
  EXPECT_NE(why(decode(message_of("32FC1\x1b[2J", 4))).find("encoding 32FC1?[2J, expected"), std::string::npos);
  ImageMessage message = message_of("bgr8", 3);
  message.data.resize(message.step + 11);
  EXPECT_EQ(why(decode(message)), "26 bytes with a step of 15 for 4x2 bgr8");
  message = message_of("bgr8", 3);
  message.step = 11;
  EXPECT_NE(why(decode(message)), "");
  message.step = 0xffffffff;
  EXPECT_NE(why(decode(message)), "");
  message = message_of("bgr8", 3);
  message.width = 0xffffffff;
  EXPECT_EQ(why(decode(message)), "size 4294967295x2");
  message.width = 0;
  EXPECT_EQ(why(decode(message)), "size 0x2");
  message = message_of("yuv422", 2);
  message.width = 3;
  EXPECT_EQ(why(decode(message)), "size 3x2");
}

TEST(ImageDecoder, WhateverTheFieldsHoldItAnswers) {
  Random random(1);
  const auto number = [&] { return static_cast<std::uint32_t>(std::abs(random.normal()) * 8); };
  const std::array words{"bgr8", "rgb16", "yuv422", "bayer_rggb8", "bayer_gbrg16", "mono8", ""};
  for (int k = 0; k < 3000; ++k) {
    ImageMessage message;
    message.width = number(), message.height = number(), message.step = number() * 4;
    message.encoding = words[k % words.size()];
    message.data.resize(number() * number() * 4);
    const DecodedImage image = decode(message);
    if (const auto* bgr = std::get_if<cv::Mat>(&image)) {
      EXPECT_EQ(bgr->type(), CV_8UC3);
      EXPECT_EQ(bgr->cols, static_cast<int>(message.width));
    }
  }
}

TEST(ImageDecoder, CompressedImages) {
  cv::Mat picture(48, 64, CV_8UC3);
  cv::randu(picture, cv::Scalar::all(0), cv::Scalar::all(255));
  CompressedImageMessage message;
  message.format = "bgr8; png compressed bgr8";
  message.data = encode_png(picture);
  const DecodedImage png = decode(message);
  ASSERT_TRUE(std::holds_alternative<cv::Mat>(png));
  EXPECT_EQ(cv::norm(std::get<cv::Mat>(png), picture, cv::NORM_INF), 0);
  message.data.resize(message.data.size() / 2);
  EXPECT_NE(why(decode(message)), "");
  message.data.clear();
  EXPECT_NE(why(decode(message)), "");
  message.data.assign(1000, 7);
  message.format = std::string(100000, '\x1b');
  EXPECT_LT(why(decode(message)).size(), 300u);
}

}  // namespace
}  // namespace lapservo::internal
