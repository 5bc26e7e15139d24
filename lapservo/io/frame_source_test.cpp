#include "lapservo/io/frame_source.h"

#include <chrono>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/io/jpeg_encoding.h"
#include "lapservo/io/video_reader.h"
#include "lapservo/io/video_writer.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

constexpr int frames = 20;

void write_video(const fs::path& path) {
  VideoWriter video(path, 25);
  cv::RNG random(7);
  for (int i = 0; i < frames; ++i) {
    cv::Mat image(240, 320, CV_8UC3);
    random.fill(image, cv::RNG::UNIFORM, 60, 200);
    image(cv::Rect(10 * i, 50, 40, 40)).setTo(cv::Scalar(20, 40, 250));
    video.add(image);
  }
  video.commit();
}

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

struct Read {
  int frames = 0, damaged = 0;
  std::string complaint;
};

Read read(const fs::path& path) {
  const auto source = open_frame_source(path.string(), 30);
  Read result;
  while (const auto frame = source->next()) {
    EXPECT_EQ(frame->index, result.frames);
    EXPECT_EQ(frame->bgr.size(), cv::Size(320, 240));
    ++result.frames;
    result.damaged += frame->flaw == Status::damaged;
  }
  result.complaint = source->complaint();
  return result;
}

TEST(VideoSource, GivesEveryFrameOfAWholeVideo) {
  const testing::TemporaryFolder folder;
  for (const char* name : {"a.mp4", "a.mkv", "a.avi", "a.ts"}) {
    write_video(folder / name);
    const Read whole = read(folder / name);
    EXPECT_EQ(whole.frames, frames) << name;
    EXPECT_EQ(whole.damaged, 0) << name;
    EXPECT_EQ(whole.complaint, "") << name;
  }
}

// Whoever takes his time with the frames gets them all.
TEST(VideoReader, IsPatientOnceItIsOpen) {
  const testing::TemporaryFolder folder;
  write_video(folder / "a.mkv");
  constexpr std::chrono::seconds patience(2);
  VideoReader reader(folder / "a.mkv", patience);
  std::this_thread::sleep_for(patience + std::chrono::milliseconds(50));
  int count = 0;
  while (reader.next()) ++count;
  EXPECT_EQ(count, frames);
  EXPECT_EQ(reader.complaint(), "");
}

TEST(VideoSource, SaysThatAVideoEndsEarly) {
  const testing::TemporaryFolder folder;
  for (const char* name : {"a.mkv", "a.avi", "a.ts"}) {
    write_video(folder / name);
    const std::string whole = bytes_of(folder / name);
    testing::write_file(folder / name, whole.substr(0, whole.size() / 2));
    const Read half = read(folder / name);
    EXPECT_LT(half.frames, frames) << name;
    EXPECT_NE(half.complaint, "") << name;
  }
}

// Of damage within its data the decoder learns most of the time; then the frame says so and the video as a whole.
TEST(VideoSource, MarksDamagedFrames) {
  const testing::TemporaryFolder folder;
  for (const char* name : {"a.mp4", "a.avi"}) {
    write_video(folder / name);
    std::string bytes = bytes_of(folder / name);
    Random random(3);
    for (std::size_t i = bytes.size() / 3; i < bytes.size() / 3 + 200; ++i)
      bytes[i] = static_cast<char>(random.bits() & 0x7f);
    testing::write_file(folder / name, bytes);
    const Read damaged = read(folder / name);
    EXPECT_GE(damaged.damaged, 1) << name;
    EXPECT_NE(damaged.complaint, "") << name;
  }
}

// A flipped bit may let a picture of motion JPEG end before its data do, with shifted rows or other colours: FFmpeg's
// decoder says nothing of that, libjpeg does.
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
  const Read damaged = read(folder / "a.mjpeg");
  EXPECT_EQ(damaged.frames, 6);
  EXPECT_EQ(damaged.damaged, 1);
}

TEST(OpenFrameSource, NamesWhatCanNotBeRead) {
  const testing::TemporaryFolder folder;
  const auto said = [&](const std::string& input) {
    return testing::input_error([&] { open_frame_source(input, 30); });
  };
  testing::write_file(folder / "text.mp4", "this is no film");
  EXPECT_EQ(said((folder / "text.mp4").string()),
            (folder / "text.mp4").string() + ": can't be read, expected a picture or a video");
  EXPECT_EQ(said("/dev/zero"), "/dev/zero: is no file, expected a picture, a folder or a video");
  EXPECT_NE(said(std::string(300, 'a')).find("does not exist"), std::string::npos);
}

}  // namespace
}  // namespace lapservo::internal
