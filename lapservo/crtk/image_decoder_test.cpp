#include "lapservo/crtk/image_decoder.h"

#include <cstdint>
#include <utility>
#include <variant>

#include <gtest/gtest.h>

#include "lapservo/io/pictures/png_picture.h"

namespace lapservo::internal::image_decoder_test {

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

TEST(ImageDecoder, AnImageIsTheMessageThatItIsDecodedFrom) {
  const cv::Mat whole(5, 7, CV_8UC3);
  cv::randu(whole, 0, 256);
  const cv::Mat part = whole(cv::Rect(1, 1, 4, 3));
  for (const cv::Mat& bgr : {whole, part}) {
    const ImageMessage message = bgr8_message(bgr, 2.5);
    EXPECT_EQ(message.stamp_s, 2.5);
    EXPECT_EQ(cv::norm(std::get<cv::Mat>(decode(message)), bgr, cv::NORM_INF), 0);
  }
}

// A copy of each image of 1920x1080 would cost as much as a tracked frame.
TEST(ImageDecoder, AnImageWithoutPaddingKeepsTheBytesOfItsMessage) {
  ImageMessage message = message_of("bgr8", 3, 0);
  const std::uint8_t* const bytes = message.data.data();
  cv::Mat image = std::get<cv::Mat>(decode(std::move(message)));
  EXPECT_EQ(image.data, bytes);
  cv::Mat second = image;
  image.create(5, 7, CV_8UC3);
  EXPECT_EQ(second.at<cv::Vec3b>(0, 0), cv::Vec3b(3, 10, 17));
}

// Luma and both chroma of a colour by the equations of Rec. 601 (below 720 rows) or 709, limited range.
std::array<std::uint8_t, 3> yuv_of(const cv::Vec3b& bgr, int rows) {
  const double kr = rows >= 720 ? 0.2126 : 0.299, kb = rows >= 720 ? 0.0722 : 0.114;
  const double b = bgr[0] / 255.0, g = bgr[1] / 255.0, r = bgr[2] / 255.0;
  const double y = kr * r + (1 - kr - kb) * g + kb * b;
  const auto byte = [](double value) { return static_cast<std::uint8_t>(std::lround(value)); };
  return {byte(16 + 219 * y), byte(128 + 112 * (b - y) / (1 - kb)), byte(128 + 112 * (r - y) / (1 - kr))};
}

// The cells of a row that repeat, how many pixels they are, and those of every second row.
struct Pattern {
  std::vector<std::uint8_t> cells;
  std::size_t pixels = 1;
  std::vector<std::uint8_t> below = cells;
};

Pattern pattern_of(const std::string& encoding, const cv::Vec3b& bgr, int rows) {
  const auto [y, u, v] = yuv_of(bgr, rows);
  const std::uint8_t b = bgr[0], g = bgr[1], r = bgr[2];
  if (encoding.starts_with("bayer")) {
    const auto cell = [&](std::size_t i) { return encoding[6 + i] == 'r' ? r : encoding[6 + i] == 'g' ? g : b; };
    return {{cell(0), cell(1)}, 2, {cell(2), cell(3)}};
  }
  if (encoding == "yuv422" || encoding == "uyvy") return {{u, y, v, y}, 2};
  if (encoding == "yuv422_yuy2" || encoding == "yuyv") return {{y, u, y, v}, 2};
  if (encoding == "nv12") return {{y}};
  std::vector<std::uint8_t> cells = encoding.starts_with("rgb") ? std::vector{r, g, b} : std::vector{b, g, r};
  if (encoding.find('a') != std::string::npos) cells.push_back(255);
  return {cells};
}

// A message of 8 columns, all of one colour.
ImageMessage message_of_colour(const std::string& encoding, const cv::Vec3b& bgr, int rows) {
  const Pattern pattern = pattern_of(encoding, bgr, rows);
  const bool is_deep = encoding.find("16") != std::string::npos;
  ImageMessage message;
  message.width = 8, message.height = static_cast<std::uint32_t>(rows), message.encoding = encoding;
  for (int row = 0; row < rows; ++row)
    for (std::size_t pixel = 0; pixel < 8; pixel += pattern.pixels)
      for (const std::uint8_t cell : row % 2 == 0 ? pattern.cells : pattern.below) {
        if (is_deep) message.data.push_back(77);  // the lower byte
        message.data.push_back(cell);
      }
  message.step = static_cast<std::uint32_t>(message.data.size() / rows);
  const auto [y, u, v] = yuv_of(bgr, rows);
  if (encoding == "nv12")
    for (int i = 0; i < rows / 2 * 4; ++i) message.data.insert(message.data.end(), {u, v});
  return message;
}

TEST(ImageDecoder, PureColoursStayPureInEveryEncoding) {
  for (const char* encoding :
       {"bgr8",        "8UC3",        "rgb8",         "bgra8",        "rgba8",        "bgr16",       "rgb16",
        "yuv422",      "uyvy",        "yuv422_yuy2",  "yuyv",         "nv12",         "bayer_rggb8", "bayer_bggr8",
        "bayer_gbrg8", "bayer_grbg8", "bayer_rggb16", "bayer_bggr16", "bayer_gbrg16", "bayer_grbg16"})
    for (const int rows : {6, 720})
      for (const cv::Vec3b& bgr :
           {cv::Vec3b(0, 0, 255), cv::Vec3b(0, 255, 0), cv::Vec3b(255, 0, 0), cv::Vec3b(128, 128, 128)}) {
        const DecodedImage image = decode(message_of_colour(encoding, bgr, rows));
        ASSERT_TRUE(std::holds_alternative<cv::Mat>(image)) << encoding << ": " << why(image);
        ASSERT_EQ(std::get<cv::Mat>(image).size(), cv::Size(8, rows));
        for (const int row : {2, 3})
          for (const int column : {3, 4})
            for (int i = 0; i < 3; ++i)
              EXPECT_NEAR(bgr_at(image, row, column)[i], bgr[i], 2) << encoding << ' ' << rows << ' ' << i;
      }
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
  message = message_of("nv12", 1);
  EXPECT_EQ(why(decode(message)), "14 bytes with a step of 7 for 4x2 nv12");
  message.height = 3;
  EXPECT_EQ(why(decode(message)), "size 4x3");
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

}  // namespace lapservo::internal::image_decoder_test
