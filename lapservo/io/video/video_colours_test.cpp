// Pure colours through the videos that FFmpeg writes, by matrix, range, codec and sampling of chroma.
#include <array>
#include <string>
#include <tuple>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "lapservo/io/frame_source.h"
#include "lapservo/io/video/video_reader.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/testing/videos.h"

namespace lapservo::internal::video_colours_test {
using testing::expect_patches;
using testing::patch_px;
using testing::patches_of;

const std::array<cv::Vec3b, 4> patches{cv::Vec3b{0, 0, 255}, {0, 255, 0}, {255, 0, 0}, {128, 128, 128}};

struct Colours {
  const char* matrix;  // as FFmpeg's scale names it, and as its option -colorspace does
  const char* tag;
  const char* range;
};
struct Coding {
  const char* options;
  const char* ending;
};

class VideoColours : public ::testing::TestWithParam<std::tuple<Colours, Coding>> {};

TEST_P(VideoColours, ReadAsTheirTagsSay) {
  const auto& [colours, coding] = GetParam();
  const testing::TemporaryFolder folder;
  const auto path = folder / (std::string("a.") + coding.ending);
  const std::string tags = std::string(" -colorspace ") + colours.tag + " -color_range " + colours.range;
  const std::string filters =
      std::string("-vf scale=out_color_matrix=") + colours.matrix + ":out_range=" + colours.range +
      ":flags=accurate_rnd+full_chroma_int,setparams=colorspace=" + colours.tag + ":range=" + colours.range + " ";
  if (!testing::write_by_ffmpeg(path, patches_of(patches, patch_px), filters + coding.options + tags, 3))
    GTEST_SKIP() << "FFmpeg here can't write " << coding.options;
  const auto source = open_frame_source(path.string(), 30);
  int frames = 0;
  while (const auto frame = source->next()) {
    ++frames;
    expect_patches(frame->bgr, patches, 2);
  }
  EXPECT_EQ(frames, 3);
}

// A recorder's MPEG-2 names no encoder; x264 does.
TEST(VideoWithoutTags, IsReadByItsHeightOrItsWriterOrAsGiven) {
  const testing::TemporaryFolder folder;
  struct Video {
    const char* matrix;
    int height_px;
    const char* name;
    VideoReading reading;
    std::string remark;
  };
  for (const Video& video :
       {Video{"bt709", 720, "a.mpg", {}, "read as Rec. 709, as it is 720 rows high"},
        Video{"bt601", 480, "a.mpg", {}, ""}, Video{"bt601", 720, "a.mpg", {.colour_matrix = "bt601"}, ""},
        Video{"bt601", 720, "a.mp4", {}, "read as Rec. 601 with chroma amid the pixels"},
        Video{"bt601", 480, "a.mp4", {}, ""}, Video{"bt709", 720, "a.mp4", {.colour_matrix = "bt709"}, ""}}) {
    const std::string path = (folder / video.name).string();
    const std::string arguments = std::string("-vf scale=out_range=tv:flags=accurate_rnd:out_color_matrix=") +
                                  video.matrix + ",setparams=colorspace=unknown -pix_fmt yuv420p " +
                                  (path.ends_with("mpg") ? "-c:v mpeg2video -q:v 1 -dc 10" : "-c:v libx264 -crf 2");
    if (!testing::write_by_ffmpeg(path, patches_of(patches, video.height_px), arguments))
      GTEST_SKIP() << "FFmpeg here can't write " << video.name;
    SCOPED_TRACE(path + ", " + std::to_string(video.height_px) + " rows, " + video.reading.colour_matrix);
    const auto source = open_frame_source(path, 25, video.reading);
    EXPECT_NE(source->remark().find(video.remark), std::string::npos) << source->remark();
    EXPECT_EQ(source->remark().empty(), video.remark.empty()) << source->remark();
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    expect_patches(frame->bgr, patches, 3);
  }
  for (const char* format : {"bgr0", "gray", "yuv444p"}) {
    const std::string path = (folder / (std::string(format) + ".mkv")).string();
    if (!testing::write_by_ffmpeg(path, patches_of(patches, 480), std::string("-c:v ffv1 -pix_fmt ") + format))
      GTEST_SKIP() << "FFmpeg here can't write " << format;
    const auto source = open_frame_source(path, 25, {.chroma_location = "left"});
    EXPECT_EQ(source->remark(), std::string(format) == "yuv444p" ? "" : internal::ignored_colours_text) << format;
  }
  EXPECT_EQ(testing::input_error([&] { open_frame_source((folder / "a.mp4").string(), 25, {.colour_matrix = "709"}); }),
            "colour matrix: is 709, expected bt601, bt709 or bt2020");
  EXPECT_EQ(
      testing::input_error([&] { open_frame_source((folder / "a.mp4").string(), 25, {.chroma_location = "mid"}); }),
      "chroma location: is mid, expected left, centre or top-left");
}

// Whoever wrote them: editors write recorders' videos anew.
TEST(VideoWithoutTags, OfARecordersCodecIsReadByItsHeight) {
  const testing::TemporaryFolder folder;
  int written = 0;
  for (const char* codec : {"prores_ks -profile:v 3", "dnxhd -profile:v dnxhr_hq",
                            "cfhd -quality film3+ -pix_fmt yuv422p10le", "v210", "jpeg2000 -pix_fmt yuv422p"})
    for (const auto& [matrix, height_px] : {std::pair{"bt709", 720}, {"bt709", 1088}, {"bt601", 480}}) {
      const std::string path = (folder / "a.mov").string();
      if (!testing::write_by_ffmpeg(path, patches_of(patches, height_px),
                                    std::string("-vf scale=out_range=tv:flags=accurate_rnd:out_color_matrix=") +
                                        matrix + ",setparams=colorspace=unknown -c:v " + codec))
        continue;
      ++written;
      SCOPED_TRACE(std::string(codec) + ", " + std::to_string(height_px) + " rows");
      const auto source = open_frame_source(path, 25);
      EXPECT_EQ(source->remark().find("read as Rec. 709") != std::string::npos, height_px >= 720) << source->remark();
      const auto frame = source->next();
      ASSERT_TRUE(frame);
      expect_patches(frame->bgr, patches, 4);
    }
  if (written == 0) GTEST_SKIP() << "no ffmpeg";
}

// Red in the rows of one field, blue in those of the other.
TEST(VideoFields, HaveTheirOwnChroma) {
  const testing::TemporaryFolder folder;
  cv::Mat picture(64, 64, CV_8UC3);
  for (int row = 0; row < picture.rows; ++row) picture.row(row).setTo(patches[row % 2 == 0 ? 0 : 2]);
  const auto path = folder / "a.mkv";
  if (!testing::write_by_ffmpeg(path, picture,
                                "-vf scale=interl=1:out_color_matrix=bt709:out_range=tv:flags=accurate_rnd "
                                "-c:v ffv1 -pix_fmt yuv420p -colorspace bt709 -color_range tv"))
    GTEST_SKIP() << "no ffmpeg";
  const auto frame = open_frame_source(path.string(), 25, {.deinterlaced = true})->next();
  ASSERT_TRUE(frame);
  for (const int row : {30, 31, 32, 33})
    for (int channel = 0; channel < 3; ++channel)
      EXPECT_NEAR(frame->bgr.at<cv::Vec3b>(row, 32)[channel], picture.at<cv::Vec3b>(row, 32)[channel], 2)
          << "row " << row << ", " << channel;
}

INSTANTIATE_TEST_SUITE_P(
    Tags, VideoColours,
    ::testing::Combine(::testing::Values(Colours{"bt709", "bt709", "tv"}, Colours{"bt709", "bt709", "pc"},
                                         Colours{"bt601", "smpte170m", "tv"}, Colours{"bt601", "bt470bg", "pc"},
                                         Colours{"bt2020", "bt2020nc", "tv"}, Colours{"smpte240m", "smpte240m", "tv"}),
                       ::testing::Values(Coding{"-c:v libx264 -qp 0 -pix_fmt yuv444p", "mp4"},
                                         Coding{"-c:v libx264 -crf 2 -pix_fmt yuv420p", "mkv"},
                                         Coding{"-c:v libvpx-vp9 -lossless 1 -pix_fmt yuv444p", "webm"},
                                         Coding{"-c:v ffv1 -pix_fmt yuv422p", "mkv"},
                                         Coding{"-c:v prores_ks -profile:v 4444 -pix_fmt yuv444p10le", "mov"})));

}  // namespace lapservo::internal::video_colours_test
