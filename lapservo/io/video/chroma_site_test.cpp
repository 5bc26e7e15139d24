// Colour edges at known places through what FFmpeg writes, by where the format or its tags put chroma.
#include <algorithm>
#include <array>
#include <cstdlib>
#include <string>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "lapservo/io/frame_source.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo {
namespace {

constexpr int side_px = 96;
const cv::Scalar before(40, 40, 200), after(200, 90, 60);

// Place of a leaning edge, in all phases to the samples; compression then adds noise to a mean but no shift.
double place_px(int row) {
  return side_px / 2 + 0.23 * (row - side_px / 2);
}

// In the left half an edge that is nearly upright; in the right half the same turned over.
cv::Mat edges() {
  cv::Mat picture(side_px, 2 * side_px, CV_8UC3);
  for (int row = 0; row < side_px; ++row)
    for (int i = 0; i < side_px; ++i) {
      const double share = std::clamp(i + 0.5 - place_px(row), 0.0, 1.0);
      const cv::Scalar colour = (1 - share) * before + share * after;
      for (const cv::Point& at : {cv::Point(i, row), cv::Point(side_px + row, i)})
        picture(cv::Rect(at, cv::Size(1, 1))).setTo(colour);
    }
  return picture;
}

// How far a channel's edge lies beside its place, by the area below it; the mean of all rows.
double shift_px(const cv::Mat& half, int channel) {
  cv::Mat values;
  cv::extractChannel(half, values, channel);
  const cv::Range window(side_px / 2 - 26, side_px / 2 + 26);
  double sum_px = 0;
  int rows = 0;
  for (int row = 8; row < side_px - 8; ++row, ++rows) {
    const cv::Mat line = values.row(row);
    const double low = cv::mean(line.colRange(4, 22))[0], high = cv::mean(line.colRange(74, 92))[0];
    const double above = (cv::sum(line.colRange(window))[0] - window.size() * low) / (high - low);
    sum_px += window.end - 0.5 - above - place_px(row);
  }
  return sum_px / rows;
}

constexpr const char *left = "0:out_v_chr_pos=128", *left_422 = "0", *centre = "128:out_v_chr_pos=128",
                     *centre_422 = "128", *top_left = "0:out_v_chr_pos=0", *top = "128:out_v_chr_pos=0",
                     *bottom_left = "0:out_v_chr_pos=256";
constexpr const char *bt709 = "bt709:range=tv", *bt2020 = "bt2020nc:range=tv", *jpeg = "bt470bg:range=pc",
                     *untagged = "unknown:range=tv";

struct Coding {
  const char* site;
  const char* tags;
  const char* options;
  const char* ending;
};

class ChromaSites : public ::testing::TestWithParam<Coding> {};

TEST_P(ChromaSites, ColourEdgesAreWhereLumaHasThem) {
  const Coding& coding = GetParam();
  const testing::TemporaryFolder folder;
  const cv::Mat picture = edges();
  testing::write_file(folder / "raw", std::string(reinterpret_cast<const char*>(picture.data), picture.total() * 3));
  const std::string path = (folder / (std::string("a.") + coding.ending)).string(), tags = coding.tags;
  const std::string matrix = tags.starts_with("bt709") ? "bt709" : tags.starts_with("bt2020") ? "bt2020" : "bt601";
  const std::string command =
      "ffmpeg -v quiet -y -f rawvideo -pix_fmt bgr24 -s 192x96 -r 25 -i '" + (folder / "raw").string() +
      "' -vf scale=flags=bicubic+accurate_rnd+full_chroma_int+full_chroma_inp:out_color_matrix=" + matrix +
      ":out_range=" + tags.substr(tags.size() - 2) + ":out_h_chr_pos=" + coding.site + ",setparams=colorspace=" + tags +
      " " + coding.options + " '" + path + "'";
  if (std::system(command.c_str()) != 0) GTEST_SKIP() << "FFmpeg here can't write " << coding.options;
  const auto frame = open_frame_source(path, 25)->next();
  ASSERT_TRUE(frame);
  for (const int channel : {0, 2}) {
    EXPECT_NEAR(shift_px(frame->bgr.colRange(0, side_px), channel), 0, 0.05) << "along rows, channel " << channel;
    EXPECT_NEAR(shift_px(frame->bgr.colRange(side_px, 2 * side_px).t(), channel), 0, 0.05)
        << "along columns, channel " << channel;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Left, ChromaSites,
    ::testing::Values(Coding{left, bt709, "-c:v libx264 -crf 2 -pix_fmt yuv420p", "mp4"},
                      Coding{left_422, bt709, "-c:v libx264 -crf 2 -pix_fmt yuv422p", "mp4"},
                      Coding{left, bt709, "-c:v libx265 -x265-params lossless=1:log-level=-1 -pix_fmt yuv420p", "mp4"},
                      Coding{left_422, bt709, "-c:v libx265 -x265-params lossless=1:log-level=-1 -pix_fmt yuv422p",
                             "mp4"},
                      Coding{left, bt709, "-c:v libvpx-vp9 -lossless 1 -pix_fmt yuv420p", "webm"},
                      Coding{left, bt709, "-c:v mpeg2video -qmin 1 -q:v 1 -pix_fmt yuv420p", "mkv"},
                      Coding{left, bt709, "-c:v ffv1 -pix_fmt yuv420p", "mkv"},
                      Coding{left, bt709, "-c:v ffv1 -pix_fmt yuv420p10le", "mkv"},
                      Coding{left_422, bt709, "-c:v ffv1 -pix_fmt yuv422p", "mkv"},
                      Coding{left_422, bt709, "-c:v prores_ks -profile:v 3 -pix_fmt yuv422p10le", "mov"},
                      Coding{left, bt709,
                             "-c:v libaom-av1 -cpu-used 8 -crf 2 -bsf:v av1_metadata=chroma_sample_position=vertical "
                             "-pix_fmt yuv420p",
                             "mp4"}));

INSTANTIATE_TEST_SUITE_P(
    Centre, ChromaSites,
    ::testing::Values(Coding{centre, bt709, "-c:v libx264 -crf 2 -x264-params chromaloc=1 -pix_fmt yuv420p", "mp4"},
                      Coding{centre, bt709,
                             "-c:v libx265 -x265-params lossless=1:chromaloc=1:log-level=-1 -pix_fmt yuv420p", "mp4"},
                      Coding{centre, bt709, "-c:v mpeg1video -qmin 1 -q:v 1 -pix_fmt yuv420p", "mkv"},
                      Coding{centre, jpeg, "-c:v mjpeg -qmin 1 -q:v 1 -pix_fmt yuvj420p", "avi"},
                      Coding{centre_422, jpeg, "-c:v mjpeg -qmin 1 -q:v 1 -pix_fmt yuvj422p", "mov"},
                      Coding{centre, jpeg, "-c:v mjpeg -qmin 1 -q:v 1 -pix_fmt yuvj420p", "jpg"},
                      Coding{centre_422, jpeg, "-c:v mjpeg -qmin 1 -q:v 1 -pix_fmt yuvj422p", "jpg"},
                      Coding{centre, untagged, "-c:v libwebp -quality 100 -pix_fmt yuv420p", "webp"},
                      Coding{centre, untagged, "-c:v libx264 -crf 2 -pix_fmt yuv420p", "mp4"},
                      Coding{centre, untagged, "-c:v mpeg4 -qmin 1 -q:v 1 -pix_fmt yuv420p", "avi"},
                      Coding{centre_422, untagged, "-c:v ffv1 -pix_fmt yuv422p", "mkv"}));

INSTANTIATE_TEST_SUITE_P(
    Elsewhere, ChromaSites,
    ::testing::Values(Coding{top_left, bt709, "-c:v libx264 -crf 2 -x264-params chromaloc=2 -pix_fmt yuv420p", "mp4"},
                      Coding{top_left, bt709,
                             "-c:v libx265 -x265-params lossless=1:chromaloc=2:log-level=-1 -pix_fmt yuv420p", "mp4"},
                      Coding{top_left, bt2020, "-c:v ffv1 -pix_fmt yuv420p", "mkv"},
                      Coding{top, bt709, "-c:v libx264 -crf 2 -x264-params chromaloc=3 -pix_fmt yuv420p", "mkv"},
                      Coding{bottom_left, bt709, "-c:v libx264 -crf 2 -x264-params chromaloc=4 -pix_fmt yuv420p",
                             "mp4"}));

}  // namespace
}  // namespace lapservo
