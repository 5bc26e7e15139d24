// Times of videos that FFmpeg writes: frames dropped, and cut without being encoded again.
#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/io/frame_source.h"
#include "lapservo/io/video/video_writer.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/testing/videos.h"

namespace lapservo::internal::video_times_test {
using testing::ffmpeg;

struct TimesRead {
  std::vector<double> s;
  std::string complaint;
};

TimesRead read_times(const std::filesystem::path& path) {
  const auto source = open_frame_source(path.string(), 30);
  TimesRead times;
  while (const auto frame = source->next()) times.s.push_back(frame->time_s);
  times.complaint = source->complaint();
  return times;
}

TEST(VideoTimes, AreTheContainersWhereFramesWereDropped) {
  const testing::TemporaryFolder folder;
  constexpr double fps = 25;
  for (const char* name : {"a.mp4", "a.mkv", "a.mov", "a.flv", "a.wmv", "a.webm"}) {
    const auto path = folder / name;
    if (!ffmpeg("-f lavfi -i testsrc=s=64x48:r=25:d=4 -vf \"select='lt(n,30)+gt(n,74)'\" -vsync vfr " + path.string()))
      continue;  // an encoder is missing
    const TimesRead times = read_times(path);
    ASSERT_EQ(times.s.size(), 55U) << name;
    for (std::size_t i = 0; i < times.s.size(); ++i)
      EXPECT_NEAR(times.s[i], static_cast<double>(i < 30 ? i : i + 45) / fps, 1.01e-3) << name << ", frame " << i;
    EXPECT_EQ(times.complaint, "") << name;
  }
}

TEST(VideoTimes, BeginWithAFirstFrameThatCanNotBeDecoded) {
  const testing::TemporaryFolder folder;
  const auto path = folder / "a.mkv";
  if (!ffmpeg("-f lavfi -i testsrc=s=64x48:r=25:d=1 -vf \"select='not(between(n,1,9))'\" -vsync vfr -c:v mjpeg " +
              path.string()))
    GTEST_SKIP() << "no ffmpeg";
  std::string bytes = testing::read_file(path);
  bytes.at(bytes.find("\xff\xc0", bytes.find("\xff\xd8\xff")) + 1) = '\xed';  // no frame header
  testing::write_file(path, bytes);
  const TimesRead times = read_times(path);
  ASSERT_EQ(times.s.size(), 16U);
  for (std::size_t i = 0; i < times.s.size(); ++i)
    EXPECT_NEAR(times.s[i], i == 0 ? 0 : 0.36 + 0.04 * static_cast<double>(i), 1.01e-3) << "frame " << i;
}

TEST(VideoTimes, AreWrittenAsTheyAreRead) {
  const testing::TemporaryFolder folder;
  const std::vector<double> times{0, 0.04, 0.5, 0.533, 2};
  const cv::Mat frame(48, 64, CV_8UC3, cv::Scalar(40, 90, 200));
  for (const auto& [name, within_s] :
       {std::pair{"a.mp4", 1e-3}, {"a.mkv", 1e-3}, {"a.mov", 1e-3}, {"a.ts", 1e-3}, {"a.avi", 0.04}}) {
    const auto path = folder / name;
    internal::VideoWriter video(path, 25);
    for (const double time_s : times) video.add(frame, time_s);
    video.commit();
    const TimesRead read = read_times(path);
    ASSERT_EQ(read.s.size(), times.size()) << name;
    for (std::size_t i = 0; i < times.size(); ++i)
      EXPECT_NEAR(read.s[i], times[i], within_s + 1e-9) << name << ", frame " << i;
    EXPECT_EQ(read.complaint, "") << name;
  }
}

// Sound and subtitles before and after the video.
TEST(VideoTimes, EndWithTheVideoWhateverLastsLonger) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "a.srt",
                      "1\n00:00:00,000 --> 00:00:01,000\nfirst\n\n2\n00:00:05,000 --> 00:00:09,000\nlast\n");
  const std::string video = "-f lavfi -i testsrc=s=64x48:r=25:d=2 ";
  const std::string late_video = "-f lavfi -itsoffset 3 -i testsrc=s=64x48:r=25:d=2 ";
  const std::string sound = "-f lavfi -i sine=d=4 ", subtitles = "-i '" + (folder / "a.srt").string() + "' ";
  int written = 0;
  for (const auto& [name, arguments] : {std::pair{"a.mkv", video + sound},
                                        {"a.webm", video + sound},
                                        {"a.flv", video + sound + "-ar 44100 "},
                                        {"a.wmv", video + sound},
                                        {"a.mp4", video + sound},
                                        {"a.mov", video + sound},
                                        {"a.avi", video + sound},
                                        {"a.ts", video + sound},
                                        {"a.m2ts", video + sound},
                                        {"b.mkv", video + subtitles},
                                        {"b.mp4", video + subtitles + "-c:s mov_text "},
                                        {"c.mkv", late_video + sound},
                                        {"c.webm", late_video + sound}}) {
    if (!ffmpeg(arguments + "'" + (folder / name).string() + "'")) continue;  // an encoder is missing
    ++written;
    const TimesRead times = read_times(folder / name);
    EXPECT_NEAR(static_cast<double>(times.s.size()), 50, 2) << name;
    EXPECT_EQ(times.complaint, "") << name;
  }
  if (written == 0) GTEST_SKIP() << "no ffmpeg";
  std::string with_correction;
  const std::string packets = testing::read_file(folder / "a.ts");
  for (std::size_t at = 0; at < packets.size(); at += 188)
    with_correction += packets.substr(at, 188) + std::string(16, '\0');
  testing::write_file(folder / "fec.ts", with_correction);
  EXPECT_EQ(read_times(folder / "fec.ts").complaint, "");
  for (const char* name : {"a.mkv", "a.webm", "a.flv", "a.ts", "a.m2ts", "fec.ts"}) {
    const std::string whole = testing::read_file(folder / name);
    testing::write_file(folder / name, whole.substr(0, whole.size() * 4 / 5 + 1));  // within a packet, too
    EXPECT_NE(read_times(folder / name).complaint, "") << name << " that is cut";
  }
}

// An edit list leaves out the frames before the cut that those after it are predicted from.
TEST(VideoTimes, OfACutVideoBeginAtTheCut) {
  const testing::TemporaryFolder folder;
  const auto path = folder / "a.mp4", cut = folder / "cut.mp4";
  if (!ffmpeg("-f lavfi -i testsrc=s=64x48:r=25:d=6 -g 100 " + path.string())) GTEST_SKIP() << "no ffmpeg";
  ASSERT_TRUE(ffmpeg("-ss 1.5 -i " + path.string() + " -c copy " + cut.string()));
  const TimesRead times = read_times(cut);
  ASSERT_GT(times.s.size(), 100U);
  EXPECT_EQ(times.s[0], 0);
  for (std::size_t i = 1; i < times.s.size(); ++i) EXPECT_NEAR(times.s[i] - times.s[i - 1], 0.04, 1e-4) << i;
  EXPECT_EQ(times.complaint, "");
}

}  // namespace lapservo::internal::video_times_test
