#include "lapservo/io/frame_source.h"

#include <chrono>
#include <cstdint>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/io/image_file.h"
#include "lapservo/io/pictures/jpeg_picture.h"
#include "lapservo/io/video/video_reader.h"
#include "lapservo/io/video/video_writer.h"
#include "lapservo/testing/has.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/testing/videos.h"

namespace lapservo::internal::frame_source_test {
namespace fs = std::filesystem;

constexpr int frames = testing::video_frames;
using namespace testing;

void write_video(const fs::path& path) {
  VideoWriter video(path, 25);
  testing::for_each_picture([&](const cv::Mat& image) { video.add(image); });
  video.commit();
}

std::string refusal(const fs::path& input) {
  return testing::input_error([&] { open_frame_source(input.string(), 30); });
}

// Whoever takes his time with the frames gets them all.
TEST(Video, IsPatientOnceItIsOpen) {
  const testing::TemporaryFolder folder;
  write_video(folder / "a.mkv");
  constexpr std::chrono::seconds patience(2);
  const auto video = open_video((folder / "a.mkv").string(), FrameSource::Kind::video, {}, patience);
  std::this_thread::sleep_for(patience + std::chrono::milliseconds(50));
  int count = 0;
  while (video->next()) ++count;
  EXPECT_EQ(count, frames);
  EXPECT_EQ(video->complaint(), "");
}

TEST(FolderSource, SaysWhatItLeavesOutAndTheOrderWherePointsDecide) {
  const testing::TemporaryFolder folder, points;
  testing::write_file(folder / "b.HEIC", "");
  EXPECT_NE(refusal(folder.path()).find("but in TIFF"), std::string::npos);
  write_image(folder / "a.png", cv::Mat(16, 16, CV_8UC3, cv::Scalar(20, 120, 220)));
  const auto source = open_frame_source(folder.path().string(), 30);
  EXPECT_EQ(source->frame_count(), 1);
  EXPECT_EQ(source->remark(), "1 images in TIFF, HEIC, AVIF or DICOM are left out: convert them to PNG");
  for (const char* name : {"0.5.png", "0.25.png", "10.5.png", "1.5.png"})
    write_image(points / name, cv::Mat(16, 16, CV_8UC3));
  EXPECT_EQ(open_frame_source(points.path().string(), 30)->remark(),
            "points and signs of the numbers in the names decide the order: 0.25.png, 0.5.png ... 10.5.png");
  write_image(points / "0.5.jpg", cv::Mat(16, 16, CV_8UC3));
  EXPECT_TRUE(testing::has(refusal(points.path()), "has 0.5.jpg and 0.5.png, expected one image of a name"));
  fs::create_symlink("not/fetched", points / "2.5.png");
  EXPECT_TRUE(testing::has(refusal(points.path()), "2.5.png: is a link to no file"));
}

// 12 bits as cameras' drivers leave them, and 16.
TEST(FolderSource, SaysThatTheUpperBitsAreEmpty) {
  for (const double scale : {1.0, 16.0}) {
    const cv::Mat picture(16, 16, CV_16UC3, cv::Scalar(300, 2000, 4095) * scale);
    std::string ppm = "P6\n16 16\n65535\n";  // the upper byte first
    for (std::size_t i = 0; i < picture.total() * 3; ++i)
      for (const int shift : {8, 0}) ppm += static_cast<char>(picture.ptr<std::uint16_t>()[i] >> shift);
    for (const char* name : {"a.png", "a.ppm"}) {
      const testing::TemporaryFolder folder;
      if (std::string(name) == "a.png")
        write_image(folder / name, picture);
      else
        testing::write_file(folder / name, ppm);
      const auto source = open_frame_source(folder.path().string(), 30);
      ASSERT_TRUE(source->next());
      EXPECT_EQ(source->complaint().find("multiply the values by 16") != std::string::npos, scale == 1) << name;
    }
  }
}

// The decoder notices damage within its data most of the time; then the frame and the video as a whole report it.
TEST(VideoSource, SaysThatAVideoEndsEarlyAndMarksDamagedFrames) {
  const testing::TemporaryFolder folder;
  for (const auto& [name, is_cut] :
       {std::pair{"a.mkv", true}, {"a.avi", true}, {"a.ts", true}, {"a.mp4", false}, {"a.avi", false}}) {
    write_video(folder / name);
    const std::string whole = read_file(folder / name);
    testing::write_file(folder / name,
                        is_cut ? whole.substr(0, whole.size() / 2) : with_damage(whole, whole.size() / 3, 3));
    const VideoRead read = read_video(folder / name);
    EXPECT_TRUE(is_cut ? read.frames < frames : read.damaged >= 1) << name << (is_cut ? " cut" : " damaged");
    EXPECT_NE(read.complaint, "") << name;
  }
}

// FFmpeg's decoder forgets what it complained of where it decodes an image's slices in parallel.
TEST(VideoSource, MarksDamagedFramesOfSeveralSlices) {
  const testing::TemporaryFolder folder;
  // As endoscopes' recorders may write it. Arithmetic coding, which ultrafast does without, shows less of damage.
  if (!testing::ffmpeg("-f lavfi -i color=gray:s=320x240:r=25,noise=alls=100:allf=t+u -frames:v 21 -c:v libx264 "
                       "-preset ultrafast -x264-params slices=4 '" +
                       (folder / "a.h264").string() + "'"))
    GTEST_SKIP() << "FFmpeg here lacks libx264";
  EXPECT_EQ(read_video(folder / "a.h264").complaint, "");
  const std::string whole = read_file(folder / "a.h264");
  for (std::uint64_t i = 0; i < 8; ++i) {
    testing::write_file(folder / "a.h264", with_damage(whole, whole.size() / 2, i));
    EXPECT_GT(read_video(folder / "a.h264").damaged, 0) << i;
  }
}

// A flipped bit may let an image of motion JPEG end before its data do, with shifted rows or other colours: FFmpeg's
// decoder reports nothing, libjpeg does.
TEST(VideoSource, MarksFramesOfMotionJpegWhoseDataGoOn) {
  const testing::TemporaryFolder folder;
  std::string video;
  for (int i = 0; i < 6; ++i) {
    cv::Mat image(240, 320, CV_8UC3, cv::Scalar(90, 120, 60));
    image(cv::Rect(40 * i, 50, 40, 40)).setTo(cv::Scalar(20, 40, 250));
    const std::vector<std::uint8_t> bytes = encode_jpeg(image);
    std::string frame(bytes.begin(), bytes.end());
    constexpr std::size_t end_marker = 2, more = 40;
    if (i == 3) frame.insert(frame.size() - end_marker, frame.substr(frame.size() - end_marker - more, more));
    video += frame;
  }
  testing::write_file(folder / "a.mjpeg", video);
  const VideoRead damaged = read_video(folder / "a.mjpeg");
  EXPECT_EQ(damaged.frames, 6);
  EXPECT_EQ(damaged.damaged, 1);
}

// Containers, MPEG-2 and x264 say theirs.
TEST(VideoSource, SaysTheRateThatItAssumes) {
  const testing::TemporaryFolder folder;
  const std::string video = "-f lavfi -i testsrc=s=64x48:r=50 -frames:v 10 ";
  for (const auto& [name, arguments, assumes] : {std::tuple{"a.mjpeg", "-c:v mjpeg", true},
                                                 {"b.mjpg", "-c:v mjpeg -f mjpeg", true},
                                                 {"a.m4v", "-c:v mpeg4 -f m4v", false},
                                                 {"a.avi", "-c:v mjpeg", false},
                                                 {"a.m2v", "-c:v mpeg2video", false},
                                                 {"a.h264", "-c:v libx264", false}}) {
    if (!testing::ffmpeg(video + arguments + " '" + (folder / name).string() + "'")) continue;
    const auto source = open_frame_source((folder / name).string(), 30);
    EXPECT_EQ(source->remark().find("names no times and no rate: read as 25 frames/s") != std::string::npos, assumes)
        << name << ": " << source->remark();
    EXPECT_EQ(source->frames_per_second(), assumes ? 25 : 50) << name;
  }
}

TEST(VideoSource, OfAPaletteOrOfFewBitsAChannelIsRefused) {
  const testing::TemporaryFolder folder;
  const std::string raw = "-c:v rawvideo -pix_fmt ";
  for (const auto& [name, arguments, problem] : {std::tuple{"a.gif", std::string(), "has a palette, expected"},
                                                 {"a.avi", "-c:v png -pix_fmt pal8", "has a palette, expected"},
                                                 {"rgb8.nut", raw + "rgb8", "has 2 bits a channel, expected"},
                                                 {"rgb444.nut", raw + "rgb444le", "has 4 bits a channel, expected"},
                                                 {"rgb565.nut", raw + "rgb565le", ""}}) {
    const fs::path path = folder / name;
    if (!testing::ffmpeg("-f lavfi -i testsrc=s=64x48:r=25 -frames:v 5 " + arguments + " '" + path.string() + "'"))
      GTEST_SKIP() << "FFmpeg here can't write " << name;
    const std::string said = refusal(path);
    EXPECT_TRUE(*problem == 0 ? said.empty() : testing::has(said, problem)) << name << ": " << said;
  }
}

// DICOM, and videos whose recorder was switched off before it wrote where the frames are.
TEST(OpenFrameSource, NamesWhatCanNotBeRead) {
  const testing::TemporaryFolder folder;
  for (const char* name : {"a.mp4", "a.mov", "a.m4v"}) {
    write_video(folder / name);
    const std::string whole = read_file(folder / name);
    const std::size_t index = whole.find("moov");
    ASSERT_NE(index, std::string::npos);
    testing::write_file(folder / name, whole.substr(0, index - 4));
    EXPECT_TRUE(testing::has(refusal(folder / name), "has no index (moov)"));
  }
  const std::string plain = (folder / "plain.mp4").string(), turned = (folder / "turned.mp4").string();
  write_video(plain);
  if (testing::ffmpeg("-i '" + plain + "' -c copy -metadata:s:v:0 rotate=90 '" + turned + "'")) {
    EXPECT_TRUE(testing::has(refusal(turned), "expected the camera's pixels upright: ffmpeg -i IN"));
  }
  const std::string dicom = std::string(128, '\0') + "DICM" + std::string("\2\0\0\0UL\4\0\0\0\0\0", 12);
  for (const char* name : {"a.dcm", "IM00001", "a.png", "a.mp4"}) {
    testing::write_file(folder / name, dicom);
    EXPECT_TRUE(testing::has(refusal(folder / name), "is DICOM, which is not read: write its frames as PNG"));
  }
  testing::write_file(folder / "text.mp4", "this is no film");
  EXPECT_EQ(refusal(folder / "text.mp4"),
            (folder / "text.mp4").string() + ": can't be read, expected an image or a video");
  EXPECT_EQ(refusal("/dev/zero"), "/dev/zero: is no file, expected an image, a folder or a video");
  EXPECT_NE(refusal(std::string(300, 'a')).find("does not exist"), std::string::npos);
}

}  // namespace lapservo::internal::frame_source_test
