#include <cstdint>
#include <map>
#include <string>
#include <vector>
#include <zlib.h>

#include <gtest/gtest.h>

#include "lapservo/io/image_file.h"
#include "lapservo/testing/input_error.h"

namespace lapservo::internal {
namespace tiff_picture_test {
using Bytes = std::vector<std::uint8_t>;

void append(Bytes& bytes, std::uint32_t value, int size) {
  for (int i = 0; i < size; ++i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

enum Tag : std::uint16_t {
  compression = 259,
  photometric = 262,
  samples_a_pixel = 277,
  page_number = 297,
  tile_width = 322,
  extra_samples = 338,
  sample_format = 339
};

// Two columns and rows of 8 bits a sample in one strip, little-endian; with these tags in place of plain RGB's.
Bytes tiff(const Bytes& strip, const std::map<std::uint16_t, std::uint32_t>& tags) {
  constexpr std::uint32_t header_bytes = 8, is_long = 4;
  std::map<std::uint16_t, std::uint32_t> all{{256, 2},
                                             {257, 2},
                                             {258, 8},
                                             {compression, 1},
                                             {photometric, 2},
                                             {273, 0},
                                             {samples_a_pixel, 3},
                                             {278, 2},
                                             {279, static_cast<std::uint32_t>(strip.size())}};
  for (const auto& [tag, value] : tags) all[tag] = value;
  const auto entries = static_cast<std::uint32_t>(all.size());
  const std::uint32_t bits_at = header_bytes + 2 + 12 * entries + 4;
  const std::uint32_t samples = all[samples_a_pixel];
  all[273] = bits_at + 2 * samples;
  Bytes bytes{'I', 'I', '*', 0};
  append(bytes, header_bytes, 4);
  append(bytes, entries, 2);
  for (const auto& [tag, value] : all) {
    const bool bits = tag == 258 && samples > 2;
    append(bytes, tag, 2);
    append(bytes, bits ? 3 : is_long, 2);
    append(bytes, bits ? samples : 1, 4);
    append(bytes, bits ? bits_at : value, 4);
  }
  append(bytes, 0, 4);
  for (std::uint32_t i = 0; i < samples; ++i) append(bytes, 8, 2);
  bytes.insert(bytes.end(), strip.begin(), strip.end());
  return bytes;
}

Bytes deflated(const Bytes& bytes) {
  uLongf size = compressBound(bytes.size());
  Bytes result(size);
  EXPECT_EQ(compress(result.data(), &size, bytes.data(), bytes.size()), Z_OK);
  result.resize(size);
  return result;
}

std::string refusal(const Bytes& bytes) {
  return testing::input_error([&] { decode_image(bytes, "p"); });
}

const Bytes rgb{10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 110, 120};

TEST(Tiff, MaySayThatItsFourthSampleIsAlpha) {
  Bytes rgba;
  for (std::size_t i = 0; i < rgb.size(); i += 3) rgba.insert(rgba.end(), {rgb[i], rgb[i + 1], rgb[i + 2], 255});
  const cv::Mat image = decode_image(tiff(rgba, {{samples_a_pixel, 4}, {extra_samples, 2}}), "p");
  ASSERT_EQ(image.size(), cv::Size(2, 2));
  EXPECT_EQ(image.at<cv::Vec3b>(1, 0), cv::Vec3b(90, 80, 70));
}

// The decoder leaves the others as they were, without a word.
TEST(Tiff, IsRefusedWhereItHasFewerRowsThanItSays) {
  constexpr std::uint32_t deflate = 8;
  const Bytes half(rgb.begin(), rgb.begin() + 6);
  EXPECT_NE(refusal(tiff(half, {})), "");
  EXPECT_NE(refusal(tiff(deflated(half), {{compression, deflate}})), "");
}

TEST(Tiff, OfAKindThatIsNotReadIsRefused) {
  EXPECT_EQ(refusal(tiff(rgb, {{photometric, 6}})), "p: is a TIFF in YCbCr, which is not read: convert it to PNG");
  for (const std::uint32_t jpeg : {6U, 7U}) EXPECT_NE(refusal(tiff(rgb, {{compression, jpeg}})), "");
  EXPECT_EQ(refusal(tiff(rgb, {{sample_format, 3}})),
            "p: pixel type: is floating point or signed, expected 8 or 16 bits a channel");
  EXPECT_NE(refusal(tiff(rgb, {{tile_width, 3}})), "");
  EXPECT_EQ(refusal(tiff(rgb, {{page_number, 3}})), "") << "what no decoder knows may stand there";
}

}  // namespace tiff_picture_test
}  // namespace lapservo::internal
