// Colour edges at known places through what FFmpeg writes, by where the format or its tags put chroma.
#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "lapservo/io/frame_source.h"
#include "lapservo/io/video/video_writer.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/testing/videos.h"

namespace lapservo::internal::chroma_site_test {

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

void expect_edges(const cv::Mat& bgr, double within_px) {
  for (const int channel : {0, 2}) {
    EXPECT_NEAR(shift_px(bgr.colRange(0, side_px), channel), 0, within_px) << "along rows, channel " << channel;
    EXPECT_NEAR(shift_px(bgr.colRange(side_px, 2 * side_px).t(), channel), 0, within_px)
        << "along columns, channel " << channel;
  }
}

constexpr const char *left = "0:out_v_chr_pos=128", *left_422 = "0", *centre = "128:out_v_chr_pos=128",
                     *centre_422 = "128", *top_left = "0:out_v_chr_pos=0", *top = "128:out_v_chr_pos=0",
                     *bottom_left = "0:out_v_chr_pos=256";
constexpr const char *bt709 = "bt709:range=tv", *bt2020 = "bt2020nc:range=tv", *jpeg = "bt470bg:range=pc",
                     *untagged = "unknown:range=tv";

struct Coding {
  const char* site;
  const char* tags;
  std::string options;
  const char* ending;
};

class ChromaSites : public ::testing::TestWithParam<Coding> {};

TEST_P(ChromaSites, ColourEdgesAreWhereLumaHasThem) {
  const Coding& coding = GetParam();
  const testing::TemporaryFolder folder;
  const std::string path = (folder / (std::string("a.") + coding.ending)).string(), tags = coding.tags;
  const std::string matrix = tags.starts_with("bt709") ? "bt709" : tags.starts_with("bt2020") ? "bt2020" : "bt601";
  const std::string filters =
      "-vf scale=flags=bicubic+accurate_rnd+full_chroma_int+full_chroma_inp:out_color_matrix=" + matrix +
      ":out_range=" + tags.substr(tags.size() - 2) + ":out_h_chr_pos=" + coding.site + ",setparams=colorspace=" + tags;
  if (!testing::write_by_ffmpeg(path, edges(), filters + " " + coding.options))
    GTEST_SKIP() << "FFmpeg here can't write " << coding.options;
  const auto frame = open_frame_source(path, 25)->next();
  ASSERT_TRUE(frame);
  expect_edges(frame->bgr, 0.05);
}

// Colour differences, which a video has for four pixels together, keep their place.
TEST(Videos, LeaveColoursWhereTheyAre) {
  constexpr double by_compression_px = 0.2;
  const testing::TemporaryFolder folder;
  for (const char* name : {"a.mp4", "a.mkv", "a.ts"}) {
    SCOPED_TRACE(name);
    internal::VideoWriter writer(folder / name, 30);
    for (int i = 0; i < 3; ++i) writer.add(edges());
    writer.commit();
    const auto source = open_frame_source((folder / name).string(), 30);
    for (int i = 0; i < 3; ++i) expect_edges(source->next().value().bgr, by_compression_px);
  }
}

const std::string x264 = "-c:v libx264 -crf 2 ", x265 = "-c:v libx265 -x265-params lossless=1:log-level=-1",
                  mjpeg = "-c:v mjpeg -qmin 1 -q:v 1 ", p420 = " -pix_fmt yuv420p", p422 = " -pix_fmt yuv422p";

const std::vector<Coding> codings{
    {left, bt709, x264 + p420, "mp4"},
    {left_422, bt709, x264 + p422, "mp4"},
    {left, bt709, x265 + p420, "mp4"},
    {left_422, bt709, x265 + p422, "mp4"},
    {left, bt709, "-c:v libvpx-vp9 -lossless 1" + p420, "webm"},
    {left, bt709, "-c:v mpeg2video -qmin 1 -q:v 1" + p420, "mkv"},
    {left, bt709, "-c:v ffv1" + p420, "mkv"},
    {left, bt709, "-c:v ffv1 -pix_fmt yuv420p10le", "mkv"},
    {left_422, bt709, "-c:v ffv1" + p422, "mkv"},
    {left_422, bt709, "-c:v prores_ks -profile:v 3 -pix_fmt yuv422p10le", "mov"},
    {left, bt709, "-c:v libaom-av1 -cpu-used 8 -crf 2 -bsf:v av1_metadata=chroma_sample_position=vertical" + p420,
     "mp4"},
    {centre, bt709, x264 + "-x264-params chromaloc=1" + p420, "mp4"},
    {centre, bt709, x265 + ":chromaloc=1" + p420, "mp4"},
    {centre, bt709, "-c:v mpeg1video -qmin 1 -q:v 1" + p420, "mkv"},
    {centre, jpeg, mjpeg + "-pix_fmt yuvj420p", "avi"},
    {centre_422, jpeg, mjpeg + "-pix_fmt yuvj422p", "mov"},
    {centre, jpeg, mjpeg + "-pix_fmt yuvj420p", "jpg"},
    {centre_422, jpeg, mjpeg + "-pix_fmt yuvj422p", "jpg"},
    {centre, untagged, "-c:v libwebp -quality 100" + p420, "webp"},
    {centre, untagged, x264 + p420, "mp4"},
    {centre, untagged, "-c:v mpeg4 -qmin 1 -q:v 1" + p420, "avi"},
    {centre_422, untagged, "-c:v ffv1" + p422, "mkv"},
    {top_left, bt709, x264 + "-x264-params chromaloc=2" + p420, "mp4"},
    {top_left, bt709, x265 + ":chromaloc=2" + p420, "mp4"},
    {top_left, bt2020, "-c:v ffv1" + p420, "mkv"},
    {top, bt709, x264 + "-x264-params chromaloc=3" + p420, "mkv"},
    {bottom_left, bt709, x264 + "-x264-params chromaloc=4" + p420, "mp4"}};
INSTANTIATE_TEST_SUITE_P(Of, ChromaSites, ::testing::ValuesIn(codings));

}  // namespace lapservo::internal::chroma_site_test
