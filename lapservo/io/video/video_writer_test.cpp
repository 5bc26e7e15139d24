#include "lapservo/io/video/video_writer.h"

#include <filesystem>
#include <string>
#include <sys/stat.h>

#include <gtest/gtest.h>

#include "lapservo/io/frame_source.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::video_writer_test {
namespace fs = std::filesystem;
using testing::input_error;
using testing::TemporaryFolder;

void write_noise(VideoWriter& video, int frames) {
  cv::RNG random(1);
  cv::Mat noise(120, 160, CV_8UC3);
  for (int i = 0; i < frames; ++i) {
    random.fill(noise, cv::RNG::UNIFORM, 0, 255);
    video.add(noise);
  }
  video.commit();
}

TEST(VideoWriter, IsWholeInEveryContainerAndReplacesThroughALink) {
  const TemporaryFolder folder;
  for (const std::string extension : {".mp4", ".avi", ".mkv", ".mov", ".ts"}) {
    for (const int frames : {1, 2, 25}) {
      VideoWriter video(folder / ("a" + extension), 30);
      EXPECT_EQ(input_error([&] { write_noise(video, frames); }), "") << extension << " " << frames;
    }
    EXPECT_GT(fs::file_size(folder / ("a" + extension)), 1000U);
  }
  fs::create_symlink("a.mp4", folder / "link.mp4");
  VideoWriter video(folder / "link.mp4", 29.97);
  write_noise(video, 3);
  EXPECT_TRUE(fs::is_symlink(folder / "link.mp4"));
  EXPECT_TRUE(open_frame_source((folder / "a.mp4").string(), 25)->is_lossy());
}

TEST(VideoWriter, RefusesWhatCanNotHoldOne) {
  const TemporaryFolder folder;
  const auto said = [&](const fs::path& path) {
    return input_error([&] {
      VideoWriter video(path, 30);
      write_noise(video, 1);
    });
  };
  ASSERT_EQ(::mkfifo((folder / "fifo.mp4").c_str(), 0600), 0);
  EXPECT_EQ(said(folder / "fifo.mp4"),
            (folder / "fifo.mp4").string() + ": is no regular file, expected a video to write, like overlay.mp4");
  EXPECT_EQ(said(folder / "a.xyz"),
            (folder / "a.xyz").string() + ": can't be written as a video, expected a name like overlay.mp4");
  EXPECT_FALSE(fs::exists(folder / "a.xyz"));
}

}  // namespace lapservo::internal::video_writer_test
