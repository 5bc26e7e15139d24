#include "recordings/session.h"

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "lapservo/io/video/video_writer.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"
#include "recordings/open_bag.h"

namespace lapservo::internal::session_test {
using testing::input_error;

constexpr std::int64_t begin_ns = 1700000000000000000;

// The times in a frame's record; t is the frame's.
using Times = std::function<std::string(std::int64_t t)>;
const Times as_received = [](std::int64_t t) { return fmt::format("\"recorder_reception_ns\": {}", t); };

class SessionFolder {
 public:
  SessionFolder() { std::filesystem::create_directory(path()); }
  std::filesystem::path path() const { return folder_ / "session"; }

  /// A video of `count` frames that get brighter, and its sidecar, with `recorded` records.
  void add(const std::string& name, int count, int recorded, const std::string& layout,
           const Times& times = as_received) {
    VideoWriter video(path() / (name + ".mp4"), 30);
    for (int i = 0; i < count; ++i) video.add(cv::Mat(48, 128, CV_8UC3, cv::Scalar::all(20 * (frames_ + i))));
    video.commit();
    std::string frames;
    for (int i = 0; i < recorded; ++i)
      frames += fmt::format(
          R"({}{{"frame_index": {}, "gst": {{"pts_ns": 0}}, "cpu": {{"monotonic": {{"recorder_reception_ns": 5}},)"
          R"( "realtime": {{"overlay_output_ns": 7, "stereo_output_ns": 7, {}}}}}}})",
          i > 0 ? "," : "", i, times(begin_ns + 40000000 * (frames_ + i)));
    testing::write_file(
        path() / (name + ".json"),
        fmt::format(R"({{"type": "dvrk_data:video_sidecar@1.0.0", "video_file": "{}.mp4", "side_by_side": "{}",)"
                    R"( "clock_domains": {{"cpu_realtime": {{"unit": "ns"}}}}, "frames": [{}]}})",
                    name, layout, frames));
    frames_ += count;
    videos_ += fmt::format(R"({}{{"file": "{}.mp4", "duration": 1, "frames": {}}})", videos_.empty() ? "" : ",", name,
                           recorded);
  }
  void finish(const std::string& rest = "") const {
    testing::write_file(
        path() / "index.json",
        fmt::format(R"({{"type": "dvrk_data:index@1.0.0", "streams": [{{"name": "stereo", "videos": [{}]}},)"
                    R"( {{"name": "room", "videos": []}}]{}}})",
                    videos_, rest));
  }

 private:
  testing::TemporaryFolder folder_;
  int frames_ = 0;
  std::string videos_;
};

std::vector<double> times_of(FrameSource& frames) {
  std::vector<double> times_s;
  while (const auto frame = frames.next()) {
    EXPECT_EQ(frame->index, static_cast<int>(times_s.size()));
    EXPECT_NEAR(cv::mean(frame->bgr)[1], 20 * std::round(frame->time_s / 0.04), 8);
    times_s.push_back(frame->time_s);
  }
  return times_s;
}

TEST(Session, HasTheFramesOfItsVideosByTheirRecords) {
  SessionFolder folder;
  folder.add("stereo", 5, 5, "RL");
  folder.add("stereo_001", 4, 4, "RL");
  folder.finish();
  ASSERT_TRUE(is_session(folder.path().string()));
  const auto session = open_session(folder.path().string(), "", {});
  EXPECT_EQ(session.layout, "RL");
  EXPECT_EQ(session.frames->first_stamp_s(), 1e-9 * begin_ns);
  EXPECT_EQ(session.frames->frame_count(), 9);
  EXPECT_EQ(times_of(*session.frames).size(), 9u);
  EXPECT_EQ(session.frames->complaint(), "");
}

TEST(Session, TakesTheTimesInTheDocumentedOrder) {
  const auto field = [](const char* name, std::int64_t ns) { return fmt::format("\"{}_ns\": {}", name, ns); };
  const auto one = [&](std::int64_t t) { return field("mono_source", t); };
  const auto left = [&](std::int64_t t) { return field("left_source", t); };
  const auto right = [&](std::int64_t t) { return field("right_source", t); };
  const std::int64_t off = 3000000;
  const std::vector<Times> cases{
      as_received, [&](std::int64_t t) { return left(t) + "," + as_received(t + off); },
      [&](std::int64_t t) { return right(t) + ", \"left_source_ns\": null," + as_received(t + off); },
      [&](std::int64_t t) { return left(t - off) + "," + right(t + off) + "," + as_received(t + 9 * off); },
      [&](std::int64_t t) { return one(t) + "," + left(t + off) + "," + right(t + off); },
      // The second frame has only the time that comes three frames later.
      [&](std::int64_t t) { return (t == begin_ns + 40000000 ? "" : one(t) + ",") + as_received(t + 40 * off); }};
  for (const Times& times : cases) {
    SessionFolder folder;
    folder.add("stereo", 3, 3, "undefined", times);
    folder.finish();
    const auto session = open_session(folder.path().string(), "stereo", {});
    EXPECT_EQ(session.layout, "");
    EXPECT_EQ(session.frames->first_stamp_s(), 1e-9 * begin_ns) << times(begin_ns);
    EXPECT_EQ(times_of(*session.frames).size(), 3u);
  }
}

TEST(Session, SaysWhereVideoAndRecordsDoNotGoTogether) {
  SessionFolder folder;
  folder.add("stereo", 5, 3, "LR");
  folder.finish();
  const auto frames = open_session(folder.path().string(), "", {}).frames;
  EXPECT_EQ(times_of(*frames).size(), 3u);
  EXPECT_EQ(frames->complaint(), "stereo.mp4 has 5 frames and 3 times: they may not belong together");
}

TEST(Session, HasTheBagThatItsIndexNames) {
  SessionFolder folder;
  folder.add("stereo", 1, 1, "LR");
  folder.finish();
  EXPECT_EQ(bag_of(folder.path().string()), "");
  folder.finish(R"(, "rosbags": "rosbag2")");
  EXPECT_EQ(bag_of(folder.path().string()), (folder.path() / "rosbag2").string());
  EXPECT_EQ(bag_of((folder.path() / "stereo.mp4").string()), "");
  testing::write_file(folder.path() / "joints_0.mcap", "\x89MCAP");
  folder.finish(R"(, "rosbags": "joints_0.mcap")");
  EXPECT_FALSE(is_bag(folder.path().string()));
  EXPECT_EQ(bag_of(folder.path().string()), (folder.path() / "joints_0.mcap").string());
}

TEST(Session, ThatIsDamagedIsReadOrRefused) {
  SessionFolder folder;
  folder.add("stereo", 2, 2, "LR");
  folder.finish();
  std::mt19937 random(59);
  const auto below = [&](std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(random); };
  for (const char* name : {"index.json", "stereo.json"}) {
    const std::string whole = testing::read_file(folder.path() / name);
    for (int i = 0; i < 200; ++i) {
      std::string text = whole;
      text[below(text.size())] = static_cast<char>("0[]{}\":,n-\x80"[below(11)]);
      testing::write_file(folder.path() / name, text);
      const std::string error = input_error([&] { open_session(folder.path().string(), "", {}); });
      EXPECT_EQ(error.find('\n'), std::string::npos) << error;
    }
    testing::write_file(folder.path() / name, whole);
  }
  const std::string none = input_error([&] { open_session(folder.path().string(), "room", {}); });
  EXPECT_NE(none.find("has 0 video streams of the name room"), std::string::npos) << none;
}

}  // namespace lapservo::internal::session_test
