#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <jpeglib.h>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/io/image_file.h"
#include "lapservo/io/pictures/jpeg_picture.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::jpeg_strays_test {
using Bytes = std::vector<std::uint8_t>;

constexpr std::uint64_t seed = 20261127;

cv::Mat scene() {
  Random random(seed);
  cv::Mat image(240, 320, CV_8UC3);
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u)
      for (int c = 0; c < 3; ++c)
        image.at<cv::Vec3b>(v, u)[c] = static_cast<std::uint8_t>(
            128 + 60 * std::sin(0.03 * u + c) * std::cos(0.02 * v * (c + 1)) + 3 * random.normal());
  return image;
}

// Restarts after each row of blocks, as webcams write them.
Bytes jpeg_with_restarts(const cv::Mat& bgr) {
  jpeg_compress_struct info{};
  jpeg_error_mgr errors{};
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &bytes, &size);
  info.image_width = static_cast<JDIMENSION>(bgr.cols);
  info.image_height = static_cast<JDIMENSION>(bgr.rows);
  info.input_components = 3;
  info.in_color_space = JCS_EXT_BGR;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, 90, TRUE);
  info.restart_in_rows = 1;
  jpeg_start_compress(&info, TRUE);
  while (info.next_scanline < info.image_height) {
    auto* row = const_cast<JSAMPLE*>(bgr.ptr(static_cast<int>(info.next_scanline)));
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  const Bytes jpeg(bytes, bytes + size);
  std::free(bytes);
  return jpeg;
}

const Bytes& plain() {
  static const Bytes jpeg = jpeg_with_restarts(scene());
  return jpeg;
}

// With bytes before those markers of the scan, counted from 0, that are chosen; the last one is the end's.
Bytes with_strays(const Bytes& strays, const std::function<bool(int)>& chosen) {
  Bytes jpeg;
  int marker = 0;
  for (std::size_t i = 0; i < plain().size(); ++i) {
    const bool is_marker =
        plain()[i] == 0xff && i + 1 < plain().size() && plain()[i + 1] >= 0xd0 && plain()[i + 1] <= 0xd9;
    if (is_marker && plain()[i + 1] != 0xd8 && chosen(marker++)) jpeg.insert(jpeg.end(), strays.begin(), strays.end());
    jpeg.push_back(plain()[i]);
  }
  return jpeg;
}

Bytes without_end(Bytes jpeg) {
  jpeg.resize(jpeg.size() - 2);
  return jpeg;
}

// All but the last have their pixels.
std::vector<Bytes> with_all_pixels() {
  const auto all = [](int) { return true; };
  const auto second = [](int marker) { return marker % 2 == 0; };
  const auto last = [](int marker) { return marker == 14; };
  return {with_strays({0x12}, all),       with_strays({0x5a, 0}, second),
          with_strays({0, 0, 0}, last),   with_strays(Bytes(40, 0), all),
          with_strays({0xff, 0xff}, all), with_strays({0x12, 0x34, 0x56, 0x78}, last),
          without_end(plain()),           without_end(with_strays({7, 7}, all))};
}

TEST(JpegStrays, CostNoPixelAndAreNoDamage) {
  const cv::Mat expected = decode_image(plain(), "p");
  for (const Bytes& jpeg : with_all_pixels()) {
    const Picture picture = decode_picture(jpeg, "p");
    EXPECT_FALSE(picture.flaw) << jpeg.size();
    EXPECT_EQ(cv::norm(picture.bgr, expected, cv::NORM_INF), 0) << jpeg.size();
  }
}

// FFmpeg's decoder takes the bytes before a marker for data of the blocks behind it.
TEST(JpegStrays, CostNoPixelOfAVideo) {
  const testing::TemporaryFolder folder;
  const auto write = [&](const Bytes& jpeg) {
    std::string video;
    for (int i = 0; i < 3; ++i) video.append(jpeg.begin(), jpeg.end());
    testing::write_file(folder / "a.mjpeg", video);
  };
  write(plain());
  const cv::Mat expected = open_frame_source((folder / "a.mjpeg").string(), 25)->next()->bgr.clone();
  for (const Bytes& jpeg : with_all_pixels()) {
    write(jpeg);
    const auto source = open_frame_source((folder / "a.mjpeg").string(), 25);
    int frames = 0;
    for (; const auto frame = source->next(); ++frames) {
      EXPECT_FALSE(frame->flaw);
      EXPECT_EQ(cv::norm(frame->bgr, expected, cv::NORM_INF), 0) << jpeg.size();
    }
    EXPECT_EQ(frames, 3);
    EXPECT_EQ(source->complaint(), "");
  }
}

// A flipped bit may let an interval end before its data do: what is left over are blocks.
TEST(JpegStrays, BlocksThatAreLeftOverAreNone) {
  Random random(seed);
  int left_over = 0, taken = 0;
  for (int i = 0; i < 3000; ++i) {
    Bytes jpeg = plain();
    jpeg[700 + random.bits() % (jpeg.size() - 710)] ^= static_cast<std::uint8_t>(1U << random.bits() % 8);
    const auto clean = jpeg_without_strays(jpeg);
    left_over += !clean;
    taken += clean && clean->size() < jpeg.size();
  }
  EXPECT_GT(left_over, 240);
  EXPECT_LE(taken, 8) << "of " << left_over << ", seed " << seed;
}

}  // namespace lapservo::internal::jpeg_strays_test
