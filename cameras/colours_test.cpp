#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "cameras/camera.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::colours_test {

using Rgb = std::array<int, 3>;
constexpr std::array<Rgb, 4> colours{Rgb{255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {128, 128, 128}};
constexpr int bar = 16, width = bar * static_cast<int>(colours.size()), height = 16;  // one colour beside the other

// Recommendations ITU-R BT.601 and BT.709: what red and blue add to the light.
struct Matrix {
  const char* name;
  double red, blue;
};
constexpr std::array matrices{Matrix{"bt601", 0.299, 0.114}, Matrix{"bt709", 0.2126, 0.0722}};

// As GStreamer names it: range, matrix, transfer, primaries.
std::string colorimetry(const Matrix& matrix, bool full_range) {
  const bool is_601 = std::string(matrix.name) == "bt601";
  return !full_range ? matrix.name : is_601 ? "1:4:16:4" : "1:3:5:1";
}

std::array<char, 3> yuv_of(const Rgb& rgb, const Matrix& matrix, bool full_range) {
  const double r = rgb[0] / 255.0, g = rgb[1] / 255.0, b = rgb[2] / 255.0;
  const double y = matrix.red * r + (1 - matrix.red - matrix.blue) * g + matrix.blue * b;
  const double u = (b - y) / (2 * (1 - matrix.blue)), v = (r - y) / (2 * (1 - matrix.red));
  const auto byte = [](double value) { return static_cast<char>(std::clamp(std::lround(value), 0L, 255L)); };
  if (full_range) return {byte(255 * y), byte(128 + 255 * u), byte(128 + 255 * v)};
  return {byte(16 + 219 * y), byte(128 + 224 * u), byte(128 + 224 * v)};
}

// An image's bytes in one of GStreamer's formats.
std::string bars(const std::string& format, const Matrix& matrix, bool full_range,
                 const std::array<Rgb, 4>& values = colours) {
  std::string light, u_plane, v_plane, uv_plane, packed;
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; column += 2) {
      const auto [y, u, v] = yuv_of(values[static_cast<std::size_t>(column / bar)], matrix, full_range);
      packed += {y, u, y, v};
      light += {y, y};
      if (row % 2 == 0) u_plane += u, v_plane += v, uv_plane += {u, v};
    }
  }
  return format == "yuy2" ? packed : light + (format == "nv12" ? uv_plane : u_plane + v_plane);
}

// An image of these bytes, by GStreamer.
struct Shown {
  std::string pipeline;
  std::optional<Frame> image;
};
Shown shown(const std::string& bytes, const std::string& format, const cv::Size& size, const std::string& caps) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "raw", bytes);
  const std::string pipeline = fmt::format(
      "filesrc location={} ! rawvideoparse format={} width={} height={} ! capssetter caps=video/x-raw,colorimetry={}",
      (folder / "raw").string(), format, size.width, size.height, caps);
  return {pipeline, open_camera_or_file("gst:" + pipeline, 30)->next()};
}

// Within so many levels where a channel is black, and elsewhere.
void expect_colours(const std::string& pipeline, const std::optional<Frame>& image, int within_black, int within) {
  ASSERT_TRUE(image) << pipeline;
  for (std::size_t i = 0; i < colours.size(); ++i) {
    const auto bgr = image->bgr.at<cv::Vec3b>(height / 2, static_cast<int>(i) * bar + bar / 2);
    for (std::size_t channel = 0; channel < 3; ++channel)
      EXPECT_NEAR(bgr[2 - static_cast<int>(channel)], colours[i][channel], colours[i][channel] ? within : within_black)
          << pipeline << ", colour " << i;
  }
}

TEST(Colours, AreThoseOfTheCapsColorimetry) {
  for (const char* format : {"i420", "nv12", "yuy2"}) {
    for (const Matrix& matrix : matrices) {
      for (const bool full_range : {false, true}) {
        const auto [pipeline, image] =
            shown(bars(format, matrix, full_range), format, {width, height}, colorimetry(matrix, full_range));
        expect_colours(pipeline, image, 2, 2);
      }
    }
  }
}

// White, black and the colours' grey as HLG, PQ and linear light have them.
TEST(Colours, AreLightAsTheCapsTransferSays) {
  struct Transfer {
    const char* number;  // GStreamer's
    int white, grey;
  };
  for (const Transfer& transfer : {Transfer{"15", 191, 106}, {"14", 148, 109}, {"1", 255, 55}}) {
    const std::array<Rgb, 4> values{Rgb{transfer.white, 0, 0},
                                    {0, transfer.white, 0},
                                    {0, 0, transfer.white},
                                    {transfer.grey, transfer.grey, transfer.grey}};
    const auto [pipeline, image] = shown(bars("i420", matrices[1], true, values), "i420", {width, height},
                                         fmt::format("1:3:{}:1", transfer.number));
    expect_colours(pipeline, image, 25, 6);  // of black 8 bits of linear light hold little
  }
}

// A slope of blue along columns or rows, sampled where chroma lies: `right` of and `below` the first pixel.
struct Slope {
  const char* format;
  const char* site;
  double right, below;
};

TEST(Colours, ChromaLiesWhereTheCapsPutIt) {
  constexpr int side = 32, per_pixel = 3, middle = 128, light = 120;
  for (const Slope& slope : {Slope{"i420", ",chroma-site=mpeg2", 0, 0.5},
                             {"i420", ",chroma-site=jpeg", 0.5, 0.5},
                             {"nv12", ",chroma-site=mpeg2", 0, 0.5},
                             {"yuy2", ",chroma-site=jpeg", 0, 0},
                             {"yuy2", "", 0, 0}}) {
    for (const bool along_rows : {false, true}) {
      const bool packed = std::string(slope.format) == "yuy2", interleaved = std::string(slope.format) == "nv12";
      const auto chroma = [&](double column, double row) {
        return static_cast<char>(std::lround(middle + per_pixel * ((along_rows ? row : column) - side / 2)));
      };
      std::string y, u, v;
      for (int row = 0; row < side; ++row)
        for (int column = 0; column < side; column += 2) {
          const char blue = chroma(column + slope.right, row + slope.below);
          y += packed ? std::string{light, blue, light, static_cast<char>(middle)} : std::string(2, light);
          if (!packed && row % 2 == 0) u += blue, v += static_cast<char>(middle);
          if (interleaved && row % 2 == 0) u += static_cast<char>(middle);
        }
      const auto [pipeline, image] =
          shown(y + u + (interleaved ? "" : v), slope.format, {side, side}, std::string("bt601") + slope.site);
      ASSERT_TRUE(image) << pipeline;
      for (int i = 4; i < side - 4; ++i) {
        const auto bgr = along_rows ? image->bgr.at<cv::Vec3b>(i, side / 2) : image->bgr.at<cv::Vec3b>(side / 2, i);
        EXPECT_NEAR(bgr[0], 1.164 * (light - 16) + 2.017 * per_pixel * (i - side / 2), 2) << pipeline << ", at " << i;
      }
    }
  }
}

}  // namespace lapservo::internal::colours_test
