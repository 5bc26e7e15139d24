#include "lapservo/io/live_source.h"

#include <cstdint>
#include <linux/videodev2.h>
#include <vector>

#include <gtest/gtest.h>

namespace lapservo::internal {
namespace live_source_test {

constexpr std::uint32_t width = 6, height = 4;

std::vector<std::uint8_t> buffer_of(std::size_t bytes) {
  return std::vector<std::uint8_t>(bytes, 128);
}

// By each format's rows, which may be padded but for the last one.
TEST(BgrOf, IsGreyWhereTheBuffersBytesAre) {
  struct Format {
    std::uint32_t pixel_format, row_bytes, rows;
  };
  for (const Format& format :
       {Format{V4L2_PIX_FMT_BGR24, 3 * width, height}, Format{V4L2_PIX_FMT_RGB24, 3 * width, height},
        Format{V4L2_PIX_FMT_YUYV, 2 * width, height}, Format{V4L2_PIX_FMT_UYVY, 2 * width, height},
        Format{V4L2_PIX_FMT_NV12, width, height + height / 2}}) {
    for (const std::uint32_t padding : {0U, 10U}) {
      const V4l2Layout layout{format.pixel_format, width, height, format.row_bytes + padding};
      const std::size_t bytes = (format.rows - 1) * layout.step + format.row_bytes;
      const cv::Mat bgr = bgr_of(layout, buffer_of(bytes));
      ASSERT_EQ(bgr.size(), cv::Size(width, height)) << four_letters(format.pixel_format);
      EXPECT_EQ(bgr.type(), CV_8UC3);
      EXPECT_LT(cv::norm(bgr - cv::Scalar::all(130), cv::NORM_INF), 3) << four_letters(format.pixel_format);
      EXPECT_TRUE(bgr_of(layout, buffer_of(bytes - 1)).empty()) << four_letters(format.pixel_format);
    }
    EXPECT_TRUE(bgr_of({format.pixel_format, width, height, 0}, buffer_of(1000)).empty());
    EXPECT_TRUE(bgr_of({format.pixel_format, width, height, format.row_bytes - 1}, buffer_of(1000)).empty());
  }
}

TEST(BgrOf, IsNothingOfWhatCanNotBe) {
  EXPECT_TRUE(bgr_of({V4L2_PIX_FMT_YUYV, 5, height, 10}, buffer_of(1000)).empty()) << "two pixels share their colours";
  EXPECT_TRUE(bgr_of({V4L2_PIX_FMT_NV12, width, 3, width}, buffer_of(1000)).empty());
  EXPECT_TRUE(bgr_of({V4L2_PIX_FMT_YUYV, width, 0, 2 * width}, {}).empty());
  EXPECT_TRUE(bgr_of({V4L2_PIX_FMT_GREY, width, height, width}, buffer_of(1000)).empty());
  EXPECT_TRUE(bgr_of({V4L2_PIX_FMT_MJPEG, width, height, 0}, buffer_of(1000)).empty());
}

}  // namespace live_source_test
}  // namespace lapservo::internal
