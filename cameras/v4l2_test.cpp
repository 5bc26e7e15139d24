#include <linux/videodev2.h>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cameras/camera.h"
#include "cameras/v4l2_format.h"
#include "lapservo/crtk/image_decoder.h"
#include "lapservo/io/jpeg_encoding.h"
#include "lapservo/testing/input_error.h"

namespace lapservo::internal {
namespace {

std::string best(const std::vector<V4l2Offer>& offers) {
  const auto offer = best_offer(offers);
  return offer ? four_letters(offer->pixel_format) : "";
}

TEST(V4l2Format, TakesTheFastestThenTheOneThatLosesLeast) {
  EXPECT_EQ(best({{V4L2_PIX_FMT_MJPEG, 30}, {V4L2_PIX_FMT_YUYV, 10}}), "MJPG");
  EXPECT_EQ(best({{V4L2_PIX_FMT_MJPEG, 30}, {V4L2_PIX_FMT_YUYV, 29.97}}), "YUYV");
  EXPECT_EQ(best({{V4L2_PIX_FMT_YUYV, 30}, {V4L2_PIX_FMT_MJPEG, 30}}), "YUYV");
  EXPECT_EQ(best({{V4L2_PIX_FMT_NV12, 0}, {V4L2_PIX_FMT_BGR24, 0}}), "BGR3");
  EXPECT_EQ(best({{V4L2_PIX_FMT_H264, 60}, {V4L2_PIX_FMT_NV12, 30}}), "NV12");
  EXPECT_EQ(best({{V4L2_PIX_FMT_GREY, 60}}), "");
}

// A grey picture of one light stays grey; one that is red in BGR or YUV is red.
cv::Vec3b pixel_of(std::uint32_t format, std::uint32_t step, const std::vector<std::uint8_t>& bytes) {
  const auto message = v4l2_message({format, 2, 2, step}, bytes, 1);
  const DecodedImage decoded = decode(std::get<ImageMessage>(message));
  const auto* const image = std::get_if<cv::Mat>(&decoded);
  EXPECT_TRUE(image) << four_letters(format) << (image ? "" : ": " + std::get<BadImage>(decoded).why);
  if (!image) return {};
  EXPECT_EQ(image->size(), cv::Size(2, 2));
  return image->at<cv::Vec3b>(1, 1);
}

TEST(V4l2Format, EveryRawFormatBecomesBgr) {
  EXPECT_EQ(pixel_of(V4L2_PIX_FMT_BGR24, 6, {0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3}), cv::Vec3b(1, 2, 3));
  EXPECT_EQ(pixel_of(V4L2_PIX_FMT_RGB24, 6, {0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3}), cv::Vec3b(3, 2, 1));
  // BT.601's red: Y 81, U 90, V 240.
  const auto is_red = [](const cv::Vec3b& bgr) { return bgr[0] < 10 && bgr[1] < 10 && bgr[2] > 245; };
  EXPECT_TRUE(is_red(pixel_of(V4L2_PIX_FMT_YUYV, 4, {0, 128, 0, 128, 81, 90, 81, 240})));
  EXPECT_TRUE(is_red(pixel_of(V4L2_PIX_FMT_UYVY, 4, {128, 0, 128, 0, 90, 81, 240, 81})));
  // With rows that are longer than their pixels.
  EXPECT_TRUE(is_red(pixel_of(V4L2_PIX_FMT_NV12, 4, {81, 81, 0, 0, 81, 81, 0, 0, 90, 240, 0, 0})));
}

// Cameras leave out the Huffman tables that JPEG's standard names.
TEST(V4l2Format, MotionJpegWithoutTablesIsReadable) {
  std::vector<std::uint8_t> jpeg = encode_jpeg(cv::Mat(16, 16, CV_8UC3, cv::Scalar(10, 200, 30)));
  for (std::size_t at = 2; jpeg[at + 1] != 0xda;) {
    const std::size_t length = 2 + 256u * jpeg[at + 2] + jpeg[at + 3];
    if (jpeg[at + 1] == 0xc4) {
      jpeg.erase(jpeg.begin() + static_cast<std::ptrdiff_t>(at),
                 jpeg.begin() + static_cast<std::ptrdiff_t>(at + length));
    } else {
      at += length;
    }
  }
  const auto message = v4l2_message({V4L2_PIX_FMT_MJPEG, 16, 16, 0}, jpeg, 1);
  const DecodedImage decoded = decode(std::get<CompressedImageMessage>(message));
  ASSERT_TRUE(std::holds_alternative<cv::Mat>(decoded)) << std::get<BadImage>(decoded).why;
  const auto pixel = std::get<cv::Mat>(decoded).at<cv::Vec3b>(8, 8);
  EXPECT_NEAR(pixel[1], 200, 5);
  EXPECT_NEAR(pixel[2], 30, 5);
}

TEST(V4l2Camera, WhatIsNoCameraIsRefused) {
  const auto refusal = [](const char* device) {
    return testing::input_error([&] { open_v4l2_camera(device, 640, 480, {}); });
  };
  EXPECT_EQ(refusal("/dev/null"), "/dev/null: is no Video4Linux device, expected a camera");
  EXPECT_NE(refusal("/dev/video-none").find("can't be opened (No such file"), std::string::npos);
}

}  // namespace
}  // namespace lapservo::internal
