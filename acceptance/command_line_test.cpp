// The tool as its user meets it: exit codes, one line per complaint, nothing left half-written.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <regex>
#include <string>
#include <sys/stat.h>
#include <utility>
#include <vector>

#include <fmt/ranges.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "acceptance/tool_test.h"
#include "lapservo/core/csv.h"
#include "lapservo/crtk/messages.h"
#include "lapservo/rig/calibration_record.h"
#include "lapservo/rig/rig.h"
#include "lapservo/rig/rig_writer.h"
#include "lapservo/sim/boards.h"
#ifdef LAPSERVO_TEST_BAGS
#include "recordings/test_bags.h"
#endif

namespace lapservo::internal::command_line_test {
namespace fs = std::filesystem;
using lapservo::testing::read_file;
using lapservo::testing::replaced;
using lapservo::testing::write_file;

class CommandLine : public acceptance::ToolTest {
 protected:
  // Nothing is left in out/.
  static void expect_refused(const std::string& arguments, const std::vector<std::string>& words) {
    ToolTest::expect_refused(arguments, words);
    EXPECT_TRUE(fs::is_empty("out")) << arguments << " left something behind";
  }
  static void empty_out() {
    fs::remove_all("out");
    fs::create_directory("out");
  }
  static std::string in(const std::string& name, const std::string& content) {
    write_file("in/" + name, content);
    return "in/" + name;
  }
  static void write_grey(const std::string& name) {
    cv::imwrite(name, cv::Mat(720, 1280, CV_8UC3, cv::Scalar(90, 90, 90)));
  }
  static std::string track(const std::string& input) {
    return "track " + input + " --rig configs/example.yaml --out out/obs.csv --overlay out/overlay";
  }

#ifdef LAPSERVO_TEST_BAGS
  // in/run.bag and in/run.mcap: a folder's images as PNG, and joints, by a clock that is so far ahead.
  void write_bags_of(const std::string& pictures, double fps, const CsvTable& joints, double arms_clock_s = 0) {
    constexpr double begin_s = 1700000000;
    std::vector<lapservo::testing::BagEntry> ros1, ros2;
    const auto add = [&](const char* topic, const char* type, const auto& message, double recorded_s) {
      ros1.push_back({topic, type, recorded_s, lapservo::testing::ros1_bytes(message)});
      ros2.push_back({topic, type, recorded_s, lapservo::testing::cdr_bytes(message)});
    };
    JointMessage reading{0, {"wrist"}, {0}};
    for (const std::string& name : joints.columns())
      if (name != "time_s") reading.names.push_back(name);
    for (std::size_t row = 0; row < joints.rows(); ++row) {
      reading.stamp_s = begin_s + joints.number(row, "time_s") + arms_clock_s;
      reading.positions = {7};
      for (std::size_t i = 1; i < reading.names.size(); ++i)
        reading.positions.push_back(joints.number(row, reading.names[i]));
      add("/PSM1/measured_js", "sensor_msgs/JointState", reading, reading.stamp_s - arms_clock_s);
    }
    for (int i = 0; fs::exists(fmt::format("in/{}/{:04}.png", pictures, i)); ++i) {
      const std::string png = read_file(fmt::format("in/{}/{:04}.png", pictures, i));
      add("/endoscope/image_raw/compressed", "sensor_msgs/CompressedImage",
          CompressedImageMessage{begin_s + i / fps, "png", {png.begin(), png.end()}}, begin_s + i / fps);
    }
    lapservo::testing::write_ros1_bag("in/run.bag", ros1, "lz4");
    lapservo::testing::write_mcap("in/run.mcap", ros2, {"zstd", 8, true, true});
  }
  // in/session of dvrk_data: a folder's images as the right eye, on the left of a video, and the joints of
  // write_bags_of().
  static void write_session_of(const std::string& pictures, double fps) {
    fs::create_directories("in/pairs");
    fs::create_directories("in/session/rosbag2");
    std::string frames;
    for (int i = 0; fs::exists(fmt::format("in/{}/{:04}.png", pictures, i)); ++i) {
      const cv::Mat eye = cv::imread(fmt::format("in/{}/{:04}.png", pictures, i));
      cv::Mat pair;
      cv::hconcat(eye, cv::Mat(eye.size(), eye.type(), cv::Scalar(90, 90, 90)), pair);
      cv::imwrite(fmt::format("in/pairs/{:04}.png", i), pair);
      const auto time_ns = 1700000000000000000 + std::llround(1e9 * i / fps);
      frames += fmt::format(R"({}{{"frame_index": {}, "gst": {{}}, "cpu": {{"realtime": {{"left_source_ns": {},)"
                            R"( "right_source_ns": {}, "recorder_reception_ns": {}}}}}}})",
                            i > 0 ? "," : "", i, time_ns - 1000000, time_ns + 1000000, time_ns + 70000000);
    }
    ASSERT_EQ(std::system("ffmpeg -v error -framerate 30 -i in/pairs/%04d.png -c:v libx264 -preset veryfast -qp 0 "
                          "-pix_fmt yuv444p in/session/stereo.mp4"),
              0);
    in("session/stereo.json", R"({"type": "dvrk_data:video_sidecar@1.0.0", "video_file": "stereo.mp4",)"
                              R"( "side_by_side": "RL", "frames": [)" +
                                  frames + "]}");
    in("session/index.json", R"({"type": "dvrk_data:index@1.0.0", "rosbags": "rosbag2", "streams": [)"
                             R"({"name": "stereo", "videos": [{"file": "stereo.mp4"}]}]})");
    fs::copy_file("in/run.mcap", "in/session/rosbag2/rosbag2_0.mcap");
  }
  // Every number as in a run on the images themselves, except for the last digits of times.
  void expect_tracked_as(const std::string& observations, const std::string& bag, const std::string& rig) {
    expect_done("track " + bag + " --fps 8 --rig " + rig + " --out out/bag.csv");
    const CsvTable expected = CsvTable::read(observations), found = CsvTable::read("out/bag.csv");
    ASSERT_EQ(found.rows(), expected.rows());
    for (std::size_t row = 0; row < found.rows(); ++row)
      for (const std::string& column : expected.columns())
        if (column == "time_s") {
          EXPECT_NEAR(found.number(row, column), static_cast<double>(row) / 8, 1e-6);
        } else if (column != "file") {
          EXPECT_EQ(found.text(row, column), expected.text(row, column)) << column;
        }
  }
#endif
};

TEST_F(CommandLine, RenderThenTrack) {
  expect_done("render --rig configs/example.yaml --out out/frames --count 3 --seed 5");
  expect_done("track out/frames --out out/obs.csv --overlay out/overlay");
  const CsvTable observed = CsvTable::read("out/obs.csv"), truth = CsvTable::read("out/frames/truth.csv");
  ASSERT_EQ(observed.rows(), 3U);
  for (std::size_t row = 0; row < 3; ++row) {
    EXPECT_EQ(observed.text(row, "status"), "ok");
    EXPECT_EQ(observed.text(row, "file"), truth.text(row, "file"));
    EXPECT_NEAR(observed.number(row, "l_px"), truth.number(row, "l_px"), 0.2);
    EXPECT_TRUE(fs::exists("out/overlay/" + truth.text(row, "file")));
  }
  EXPECT_LT(run("track out/frames --method centerline --out out/c.csv"), 2) << errors();
}

TEST_F(CommandLine, OneOfTwoEyesSideBySideIsMeasuredAsByItself) {
  for (const char* seed : {"5", "6"})
    expect_done(std::string("render --rig configs/example.yaml --count 2 --out out/") + seed + " --seed " + seed);
  fs::create_directories("in/pairs");
  for (const std::string name : {"0000.png", "0001.png"}) {
    cv::Mat pair;
    cv::hconcat(cv::imread("out/5/" + name), cv::imread("out/6/" + name), pair);
    cv::imwrite("in/pairs/" + name, pair);
  }
  const auto track = [](const std::string& input) {
    expect_done("track " + input + " --rig configs/example.yaml --out out/eye.csv");
    return read_file("out/eye.csv");
  };
  const std::string first = track("out/5"), second = track("out/6");
  EXPECT_EQ(track("in/pairs --eye left"), first);
  EXPECT_EQ(track("in/pairs --eye right --side-by-side LR"), second);
  EXPECT_EQ(track("in/pairs --eye left --side-by-side RL"), second);
  const std::string refused = " --rig configs/example.yaml --out out/no.csv";
  cv::imwrite("in/odd.png", cv::Mat(720, 1281, CV_8UC3, cv::Scalar::all(90)));
  ToolTest::expect_refused("track in/pairs" + refused, {"2560x720"});
  ToolTest::expect_refused("track in/pairs --side-by-side RL" + refused, {"--eye: is missing"});
  ToolTest::expect_refused("track in/odd.png --eye left" + refused, {"1281 columns"});
}

#ifdef LAPSERVO_GST
// Live, they are measured as from files; each frame that is not taken is counted.
TEST_F(CommandLine, GStreamersPipelinesAreTracked) {
  expect_done("render --rig configs/example.yaml --out out/frames --count 3 --seed 5");
  std::string raw;
  for (const char* name : {"0000.png", "0001.png", "0002.png"}) {
    const cv::Mat picture = cv::imread(std::string("out/frames/") + name);
    raw.append(reinterpret_cast<const char*>(picture.data), picture.total() * picture.elemSize());
  }
  const std::string pipeline = "'gst:filesrc location=" + in("frames.raw", raw) +
                               " ! rawvideoparse format=bgr width=1280 height=720 framerate=1/1'";
  expect_done("track out/frames --rig configs/example.yaml --single --out out/files.csv");
  expect_done("track " + pipeline + " --rig configs/example.yaml --single --out out/live.csv");
  const CsvTable files = CsvTable::read("out/files.csv"), live = CsvTable::read("out/live.csv");
  ASSERT_EQ(live.rows(), 3U) << output();
  for (std::size_t row = 0; row < 3; ++row) {
    EXPECT_NEAR(live.number(row, "time_s"), static_cast<double>(row), 1e-4);
    EXPECT_EQ(live.text(row, "psi_rad"), files.text(row, "psi_rad"));
  }
  expect_done("track " + pipeline + " --rig configs/example.yaml --frames 1 --out out/live.csv");
  EXPECT_EQ(CsvTable::read("out/live.csv").rows(), 1U);
  empty_out();
  expect_refused(track("gst:nosuchelement"), {"gst:nosuchelement", "no element", "gstreamer1.0-plugins-good"});
  expect_refused("track gst:videotestsrc --out out/obs.csv", {"--rig", "is missing"});
}
#endif

TEST_F(CommandLine, BagsThatCannotBeRead) {
  expect_refused("servo --replay " + in("run.bag", "#ROSBAG V2.0\n"), {"--rig", "is missing"});
  expect_refused("servo --replay in/run.bag --rig configs/example.yaml", {"run.bag", "ROS 1 bag"});
  expect_refused("track " + in("picture.png", "?") + " --image-topic /image --out out/obs.csv",
                 {"--image-topic", "is /image, which is for bags"});
  expect_refused("calibrate registration " + in("obs.csv", "a\n") +
                     " --joint-topic /joints --rig configs/example.yaml --out out/rig.yaml",
                 {"--joint-topic", "is /joints, which is for bags"});
}

#ifdef LAPSERVO_WEB
TEST_F(CommandLine, PagesThatCanNotBeServed) {
  write_grey("in/grey.png");
  const std::string picture = "in/grey.png --rig configs/example.yaml ";
  const std::string track = "track " + picture + "--out out/obs.csv ";
  expect_refused(track + "--listen 0.0.0.0", {"--listen", "expected --web"});
  expect_refused("servo --robot sim --rig configs/example.yaml --listen 0.0.0.0", {"--listen", "expected --web"});
  expect_refused(track + "--web 65536", {"--web", "65536"});
  expect_refused(track + "--web 0 --listen robot.example", {"--listen", "robot.example", "an address"});
  expect_refused("view " + picture + "--web 0 --listen 192.0.2.1", {"--web", "192.0.2.1"});  // nobody's
}
#endif

TEST_F(CommandLine, UnknownWordsGetTheNearestKnownOne) {
  expect_refused("trak in/a.png", {"trak is unknown, the nearest is track"});
  expect_refused("track in/a.png --rigg=rig.yaml", {"--rigg is unknown, the nearest is --rig"});
  expect_refused("calibrate color in/a.png", {"color is unknown, the nearest is colour"});
}

TEST_F(CommandLine, Markers) {
  std::string unregistered = read_file("configs/example.yaml");
  unregistered.erase(unregistered.find("    camera_from_rcm"));
  expect_refused("render --rig " + in("free.yaml", unregistered) + " --out out/frames",
                 {"free.yaml", "camera_from_rcm", "missing"});
  const std::string zoomed =
      in("zoomed.yaml", std::regex_replace(read_file("configs/example.yaml"), std::regex("1100, 0"), "825, 0"));
  expect_done("marker show --rig " + zoomed);
  expect_in(output(), "focal length of 825 px");
  expect_done("marker show --rig configs/example.yaml --focal-px 900");
  expect_in(output(), "focal length of 900 px");
  EXPECT_EQ(errors().find("warning"), std::string::npos) << errors();
  const std::string yellow = in("yellow.yaml", std::regex_replace(read_file("configs/example.yaml"),
                                                                  std::regex("hues_deg: .90"), "hues_deg: [50"));
  expect_done("marker show --rig " + yellow);
  expect_in(errors(), "hues_deg[0] is 50");
  expect_refused("marker design --bands-upper-mm 5,5,10 --bands-lower-mm 10,5,5", {"not decodable"});
  expect_refused("marker design --diameter-mm 8 --length-mm 8", {"do not fit"});
  expect_refused("marker print --rig configs/example.yaml --out out/sheet.txt", {"sheet.txt"});
  expect_refused("marker show --rig configs/example.yaml --instrument PSM9", {"PSM9"});
}

TEST_F(CommandLine, ServoRunsAndReplays) {
  expect_done("servo --rig configs/paper.yaml --robot sim --duration 6 --seed 2 --out out/run");
  expect_in(output(), "within 1 px and 5 mrad from");
  EXPECT_EQ(CsvTable::read("out/run/log.csv").rows(), 360U);
  expect_done("servo --replay out/run/log.csv");
  expect_in(output(), "360 ticks reproduced bit for bit");

  const std::string controller = read_file("out/run/controller.yaml");
  std::ofstream("out/run/controller.yaml")
      << "gains_per_s: [4, 5, 5, 5]\n"
      << controller.substr(0, controller.find("gains")) << controller.substr(controller.find("delay_s"));
  expect_failed("servo --replay out/run/log.csv", {"tick"});
  // Replay goes by the rig that the loop had, whatever was true and whatever the method used of it.
  for (const std::string how : {"--registration-error 3,-2,1", "--method uncalibrated --rcm-px 200,150"}) {
    const std::string folder = how.find("error") != std::string::npos ? "out/off" : "out/uncalibrated";
    EXPECT_LT(run("servo --rig configs/paper.yaml --robot sim --duration 3 --seed 2 --out " + folder + " " + how), 2);
    EXPECT_EQ(fs::exists(folder + "/true_rig.yaml"), folder == "out/off");
    EXPECT_EQ(read_file(folder + "/rig.yaml"), read_file("out/run/rig.yaml"));
    expect_done("servo --replay " + folder + "/log.csv");
    expect_in(output(), "180 ticks reproduced bit for bit");
  }
  const std::string log = read_file("out/off/log.csv");
  write_file("out/off/log.csv", log.substr(0, log.find('\n') + 1));
  ToolTest::expect_refused("servo --replay out/off/log.csv", {"log.csv", "holds no tick"});
  const std::string rig = in("turned.yaml", replaced(read_file("configs/paper.yaml"), "-0.0156, 0]", "-0.0156, -3]"));
  expect_done("servo --robot sim --joint-limits configs/joint_limits/psm-classic.yaml --duration 8 --seed 3 --rig " +
              rig);
  // It converges, and then ends in a hold.
  expect_failed("servo --rig configs/paper.yaml --robot sim --duration 5.5 --seed 2 --hide 5,9",
                {"within 1 px and 5 mrad from", "ended in a hold: marker_lost"});
}

// Section V-D, to the letter.
TEST_F(CommandLine, ServoByThePapersMethod) {
  expect_failed(
      "servo --method paper --rig configs/paper.yaml --robot sim --trajectory paper --duration 3 --out out/run",
      {"Algorithm 1"});
  const CsvTable log = CsvTable::read("out/run/log.csv");
  ASSERT_EQ(log.rows(), 180U);
  double moved_s = 0;
  for (std::size_t row = 0; row < log.rows(); ++row) {
    if (row > 0 && log.text(row - 1, "action") != "hold")
      moved_s += log.number(row, "time_s") - log.number(row - 1, "time_s");
    const double swing = std::sin(0.5 * moved_s);
    EXPECT_NEAR(log.number(row, "desired_r_px"), 795 + 60 * swing, 1e-9);
  }
  expect_in(read_file("out/run/controller.yaml"), "gains_per_s: [1.92");

  run("servo --method paper --tracker surface --rig configs/paper.yaml --robot sim --duration 0.5");
  expect_in(output(), "all visible lines");
}

// A number is the whole text, finite and in its range, for every option of every subcommand.
TEST_F(CommandLine, NumbersThatAreNone) {
  const std::string frames = "render --rig configs/example.yaml --out out/frames", design = "marker design",
                    servo = "servo --rig configs/example.yaml --robot sim --out out/run",
                    estimate = "estimate-rcm " + in("obs.csv", "instrument,status\n") + " --out out/rcm.csv";
  const std::vector<std::pair<std::string, std::vector<const char*>>> options{
      {frames, {"count", "seed", "light", "smoke", "blood", "noise", "blur-px", "motion", "film-mm", "fps"}},
      {design, {"diameter-mm", "length-mm", "smallest-band-mm", "focal-px", "distance-mm", "sigma-px"}},
      {"marker print --rig configs/example.yaml --out out/sheet.pdf", {"copies"}},
      {"marker show --rig configs/example.yaml", {"focal-px", "distance-mm", "sigma-px"}},
      {servo, {"duration", "latency-ms", "fps", "seed"}},
      {estimate, {"sigma-px", "common-px"}},
      {"experiment rcm --out out/report", {"seed"}},
      {track("in/none.png"), {"fps"}}};
  for (const auto& [command, names] : options)
    for (const char* name : names)
      for (const char* value : {"nan", "-1", "1x"})
        expect_refused(command + " --" + name + " " + value, {name, "expected"});
  for (const char* list : {"start 0,1.5,nan,0", "start 0,1.5,0.1,1e999", "setpoint nan,795,365,212", "via 1,2,x,4",
                           "rcm-px nan,1", "hide 1,inf"})
    expect_refused(servo + " --" + list,
                   {std::string(list).substr(0, std::string(list).find(' ')).c_str(), "expected"});
  for (const char* value : {"1.5", "18446744073709551617", "9007199254740993"})
    expect_refused(frames + " --seed " + value, {"--seed", value, "whole number"});
  expect_refused(frames + " --count 1.5", {"--count", "1.5"});
}

TEST_F(CommandLine, AVideoThatNamesItsTransferIsReadByItUnlessTheRigSaysAnother) {
  const std::string video = "in/a.mkv";
  if (std::system(
          ("ffmpeg -v quiet -f lavfi -i testsrc=s=1280x720 -frames:v 2 -c:v ffv1 -pix_fmt yuv444p10le -color_trc "
           "arib-std-b67 -colorspace bt2020nc " +
           video)
              .c_str()) != 0)
    GTEST_SKIP() << "no ffmpeg";
  const std::string rig = read_file("configs/example.yaml");
  expect_refused("track " + video + " --rig " + in("rec709.yaml", replaced(rig, "response: srgb", "response: rec709")) +
                     " --out out/obs.csv",
                 {video, "is read as sRGB", "expected srgb"});
  expect_failed("track " + video + " --rig configs/example.yaml --out out/obs.csv",
                {video + ": names HLG: its light is read as sRGB"});
  expect_failed("track " + video + " --fps 8 --rig configs/example.yaml --out out/obs.csv",
                {video + ": --fps 8 is ignored: it is for folders of images"});
}

TEST_F(CommandLine, OptionsThatTheInputLeavesWithoutAnEffectAreNamed) {
  write_grey("in/grey.png");
  const std::string rig = " --rig configs/example.yaml --out out/obs.csv";
  expect_refused("track in/grey.png --joint-topic /x" + rig, {"--joint-topic: is /x, which is for bags"});
  expect_refused("track in/grey.png --joints ros2:/PSM1/measured_js --joint-topic /x" + rig,
                 {"--joint-topic: is /x, which is for bags"});
  for (const char* idle : {"--fps 8", "--colour-matrix bt601", "--eye left"})
    expect_refused("track ros2:/image " + std::string(idle) + rig, {"is of recordings, expected none with a topic"});
  expect_refused("calibrate marker in/grey.png --rig configs/example.yaml --out out/rig.yaml --joint-topic /x",
                 {"--joint-topic", "expected --joints with it"});
  expect_failed("track in/grey.png --chroma-location left" + rig,
                {"in/grey.png: --colour-matrix and --chroma-location are ignored: they are for videos in YCbCr"});
}

TEST_F(CommandLine, AVideoThatEndsEarlyIsMeasuredAndSaysSo) {
  expect_done("render --rig configs/example.yaml --out out/film --count 12 --moving");
  cv::VideoWriter video("in/a.mkv", cv::CAP_FFMPEG, cv::VideoWriter::fourcc('m', 'p', '4', 'v'), 25, {1280, 720});
  for (int i = 0; i < 12; ++i)
    video.write(cv::imread((i < 10 ? "out/film/000" : "out/film/00") + std::to_string(i) + ".png"));
  video.release();
  const std::string whole = read_file("in/a.mkv");
  const std::string half = in("half.mkv", whole.substr(0, whole.size() / 2));
  expect_failed("track " + half + " --rig configs/example.yaml --colour-matrix bt601 --out out/obs.csv",
                {"half.mkv: ends early"});
  const std::string said = errors();
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
  const std::size_t rows = CsvTable::read("out/obs.csv").rows();
  EXPECT_GE(rows, 3U);
  EXPECT_LT(rows, 12U);
}

TEST_F(CommandLine, TheLeastFramesASecondThatServoTakesWork) {
  const std::string servo = "servo --rig configs/paper.yaml --robot sim";
  expect_failed(servo + " --fps 6 --duration 1", {"not within 1 px"});  // it has not converged, but it ran
  expect_refused(servo + " --fps 5 --out out/run", {"--fps", "expected a number of 6"});
}

TEST_F(CommandLine, ServoRefusesWhatCanNotBe) {
  const std::string servo = "servo --rig configs/paper.yaml --out out/run";
  expect_refused(servo, {"--robot", "sim"});
  expect_refused(servo + " --robot psm9", {"--robot", "psm9", "sim"});
  expect_refused(servo + " --robot ros2:PSM2 --camera /dev/video0", {"--robot", "PSM2", "PSM1", "--instrument"});
  expect_refused(servo + " --robot sim --instrument PSM3", {"--instrument", "PSM3", "PSM1"});
  expect_refused(servo + " --robot ros2:PSM1 --camera video.mp4", {"--camera", "is video.mp4", "/dev/videoN"});
  expect_refused(servo + " --robot ros2:PSM1 --camera ''", {"--camera", "is missing", "ros2:/topic"});
  expect_refused(servo + " --robot sim --set-point 0.9,795,365,900", {"--set-point", "can't be followed at 0.00 s"});
  expect_refused(servo + " --robot sim --set-point 0.9,795", {"--set-point"});
  expect_refused(servo + " --robot sim --via 1,2,3", {"--via", "four"});
  expect_refused(servo + " --robot sim --set-point 0.9,795,365,212 --tip 0,0,0.1", {"--tip", "beside --set-point"});
  expect_refused(servo + " --robot sim --method fast", {"--method", "fast", "uncalibrated"});
  expect_refused(servo + " --robot sim --tracker magic", {"--tracker", "magic"});
  expect_refused(servo + " --robot sim --delay-ms soon", {"--delay-ms", "soon"});
  expect_refused(servo + " --robot sim --trajectory in/none.csv", {"none.csv"});
  expect_refused(servo + " --robot sim --controller in/none.yaml", {"none.yaml"});
  expect_refused(servo + " --robot sim --operator-present page", {"--operator-present", "--web"});
  expect_refused(servo + " --robot sim --operator-present /pedal", {"--operator-present", "/pedal", "page"});
  expect_refused(servo + " --robot ros2:PSM1 --enable-motion", {"--enable-motion", "--joint-limits"});
  expect_refused("servo --replay in/log.csv", {"in/log.csv: can't be opened"});
  const std::string bag = " --replay " + in("run.bag", "#ROSBAG V2.0\n");
  for (const std::string of_arm : {"--camera /dev/video0", "--control topics", "--enable-motion",
                                   "--endoscope ros2:ECM", "--setpoint-readers 2", "--tf-frames a,b,c,d"})
    for (const std::string& without : {bag, std::string(" --robot sim")})
      expect_refused(servo + without + " " + of_arm, {of_arm.substr(0, of_arm.find(' ')).c_str(), "is of an arm"});
  expect_refused(servo + bag + " --robot sim --seed 2", {"--seed", "no --replay"});
  expect_refused(servo + " --robot sim --rcm-px 200,150", {"--rcm-px", "--method uncalibrated"});
}

TEST_F(CommandLine, ExperimentsWriteAReport) {
  expect_done("experiment rcm --method surface --seed 3 --out out/report");
  EXPECT_TRUE(fs::exists("out/report/report.html"));
  EXPECT_GT(CsvTable::read("out/report/rcm.csv").rows(), 0U);
  fs::remove_all("out/report");
  expect_refused("experiment cooking --out out/report", {"cooking"});
}

TEST_F(CommandLine, HelpShowsExamples) {
  for (const char* command :
       {"track", "view", "render", "marker", "marker design", "marker print", "marker show", "servo", "experiment",
        "estimate-rcm", "sim-robot", "record", "check", "calibrate", "calibrate all", "calibrate camera",
        "calibrate colour", "calibrate marker", "calibrate registration"}) {
    expect_done(std::string(command) + " --help");
    expect_in(output(), "Example");
  }
  expect_done("align --help");
  expect_in(output(), "Example");
  expect_done("--version");
  EXPECT_EQ(output().rfind("lapservo ", 0), 0U);
  EXPECT_EQ(run("fly"), 2);
}

// By a tool in the rig, its wrist's readings beside the frames, bent by more than an arm's joint goes in metres:
// columns, overlay, and how well it is known.
TEST_F(CommandLine, TheTipIsKnownWhereToolAndWristAre) {
  const std::string joints =
      "joints: [{name: wrist_pitch, alpha_rad: -1.5707963267949, theta_rad: -1.5707963267949}], "
      "tip_in_last_joint_m: [0.01, 0, 0]";
  const std::string plain = read_file("configs/example.yaml");
  const std::string tool = "    tool: {" + joints +
                           ", wrist_in_marker_m: [0, 0, 0.03], azimuth_rad: 0.5, "
                           "sigma_wrist_in_marker_m: [0, 0, 1e-5]}\n";
  const std::string rig = in("tool.yaml", plain + tool);
  std::string poses = "theta_rad,phi_rad,rho_m,psi_rad\n", wrist = "time_s,roll,outer_wrist_pitch\n";
  for (int i = 0; i < 6; ++i) poses += std::to_string(-0.08 + 0.01 * i) + ",1.7,0.14," + std::to_string(0.1 * i) + "\n";
  for (int i = -1; i < 60; ++i) wrist += std::to_string(0.05 * i) + ",0," + std::to_string(2.2 + 0.01 * i) + "\n";
  wrist += wrist.substr(wrist.rfind('\n', wrist.size() - 2) + 1);
  expect_done("render --rig configs/example.yaml --out in/few --poses " + in("poses.csv", poses));
  expect_done("track in/few --fps 8 --rig " + rig + " --out out/seen.csv --overlay out/overlay --joints " +
              in("wrist.csv", wrist));
  EXPECT_EQ(errors(), "lapservo: in/wrist.csv: passed over: 1 repeated readings\n");
  const CsvTable seen = CsvTable::read("out/seen.csv");
  for (std::size_t row = 0; row < seen.rows(); ++row) {
    Eigen::Vector3d to_tip_m;
    for (int i = 0; i < 3; ++i) {
      const std::string axis = std::string(1, "xyz"[i]) + "_m";
      to_tip_m[i] = seen.number(row, "tip_" + axis) - seen.number(row, "marker_" + axis);
    }
    const double wrist_rad = 2.2 + 0.01 * static_cast<double>(row) / 8 / 0.05;
    EXPECT_NEAR(to_tip_m.norm(), std::hypot(0.03 + 0.01 * std::cos(wrist_rad), 0.01 * std::sin(wrist_rad)), 1e-7);
    EXPECT_GT(seen.number(row, "sigma_tip_z_m"), 0);
  }
  expect_done("track in/few --rig " + rig + " --out out/unread.csv");
  EXPECT_EQ(CsvTable::read("out/unread.csv").text(0, "tip_x_m"), "");
  EXPECT_EQ(errors(),
            "lapservo: PSM1: no tip: no readings of the wrist's joints wrist_pitch: --joints names a recording or "
            "topic that has them\n");
  expect_done("track in/few --rig " + rig + " --out out/late.csv --joints " +
              in("late.csv", "time_s,wrist_pitch\n100,2\n100.1,2\n"));
  expect_in(errors(), "PSM1: no tip: in/late.csv has no readings around the frames with the marker: they run from 0");
  expect_done("track in/few --rig " + in("unplaced.yaml", plain + "    tool: {" + joints + "}\n") +
              " --out out/un.csv");
  expect_in(errors(), "lapservo calibrate tip");
  ToolTest::expect_refused("track in/few --rig configs/example.yaml --out out/no.csv --joints in/none.csv",
                           {"--joints: is in/none.csv, expected a tool with a wrist in configs/example.yaml"});

  // One arm's readings are no other's, unless a topic's name or the joints' says so.
  const std::string psm2 = replaced(plain.substr(plain.find("  - name")), "[90, 180, 270]", "[90, 270, 180]");
  const auto two_tracked = [&](const std::string& input, const std::string& tool_of_psm2) {
    expect_done("track " + input + " --out out/two.csv --rig " +
                in("two.yaml", plain + tool + replaced(psm2, "PSM1", "PSM2") + tool_of_psm2));
    return CsvTable::read("out/two.csv").text(0, "tip_x_m");
  };
  const std::string with_table = "in/few --fps 8 --joints in/wrist.csv";
  EXPECT_EQ(two_tracked(with_table, tool), "");
  expect_in(errors(), "PSM1: no tip: in/wrist.csv may have the joints of PSM2, expected a topic .../PSM1/measured_js");
  expect_in(errors(), "PSM2: no tip: in/wrist.csv may have the joints of PSM1");
  EXPECT_NE(two_tracked(with_table, replaced(tool, "wrist_pitch", "other_pitch")), "");
  expect_in(errors(), "PSM2: no tip: no readings of the wrist's joints other_pitch");
#ifdef LAPSERVO_TEST_BAGS
  write_bags_of("few", 8, CsvTable::read("in/wrist.csv"));
  EXPECT_NE(two_tracked("in/run.bag", tool), "");
  EXPECT_TRUE(
      errors().starts_with("lapservo: in/run.bag: /PSM1/measured_js: passed over: 1 repeated readings\n"
                           "lapservo: PSM2: no tip: in/run.bag: /PSM1/measured_js may have the joints of"));
  // A delay is that of a bag if its recorder's times say so.
  const std::string delayed = in("delayed.yaml", plain + tool + "    image_delay_s: -1.5\n");
  for (const bool fits : {false, true}) {
    write_bags_of("few", 8, CsvTable::read("in/wrist.csv"), fits ? 1.5 : 0);
    expect_done("track in/run.mcap --out out/delayed.csv --rig " + delayed);
    EXPECT_NE(CsvTable::read("out/delayed.csv").text(0, "tip_x_m").empty(), fits);
    EXPECT_EQ(errors().find("image_delay_s of -1.500 s is none of in/run.mcap") == std::string::npos, fits);
  }
#endif
}

// A swinging arm whose joints are read by another clock, from the other side of its gears: from a rig that knows
// their names only.
TEST_F(CommandLine, CalibrateRegistrationWritesWhereTheArmStands) {
  std::string plain = read_file("configs/example.yaml");
  const std::string known = plain.substr(plain.find("    camera_from_rcm:"));
  plain.resize(plain.size() - known.size());
  const std::string joints_entry =
      "    joints: {names: [yaw, pitch, insertion, roll], sign: [1, 1, 1, 1], offset: [0, 0, 0, 0]}\n";
  const std::string unregistered = in("unregistered.yaml", plain + joints_entry);
  constexpr double fps = 8, clock_s = 0.4;
  constexpr int frames = 72;
  const auto q_at = [](double t) {
    return std::array{-0.0778 + 0.25 * std::sin(0.9 * t), 1.75 + 0.14 * std::sin(1.3 * t + 1),
                      0.140 + 0.010 * std::sin(0.7 * t), 1.2 * std::sin(0.8 * t + 2)};
  };
  const auto row = [](const std::array<double, 4>& numbers) { return fmt::format("{:f}\n", fmt::join(numbers, ",")); };
  const auto joints_by_clock = [&](double off_s) {
    std::string text = "time_s,yaw,pitch,insertion,roll\n";
    for (int i = -20; i < 50 * frames / fps + 20; ++i) {
      const auto q = q_at(i / 50.0);
      text += std::to_string(i / 50.0 + off_s) + "," + row({q[0], 1.5 - q[1], q[2] + 0.02, 0.7 - q[3]});
    }
    return text;
  };
  const std::string joints = joints_by_clock(-clock_s);
  std::string poses = "theta_rad,phi_rad,rho_m,psi_rad\n";
  for (int i = 0; i < frames; ++i) poses += row(q_at(i / fps));
  expect_done("render --rig configs/example.yaml --out in/swing --poses " + in("poses.csv", poses));
  const std::string calibrate = "calibrate registration in/swing --fps 8 --rig " + unregistered + " --out out/rig.yaml";
  expect_done(calibrate + " --joints " + in("joints.csv", joints));
  const Instrument found = load_rig("out/rig.yaml").instruments[0];
  EXPECT_EQ(found.joints->sign, (Joints{{}, {1, -1, 1, -1}, {}}.sign));
  EXPECT_NEAR(found.joints->offset[1], 1.5, 1.7e-3);
  EXPECT_NEAR(found.joints->offset[2], -0.02, 3e-4);
  EXPECT_NEAR(found.joints->offset[3], 0.7, 3e-3);
  EXPECT_NEAR(found.camera_from_rcm->translation.x(), -0.077782, 3e-4);
  EXPECT_NEAR(found.camera_from_rcm->translation.z(), 0.059220, 3e-4);
  EXPECT_NEAR(found.image_delay_s.value(), clock_s, 5e-3);

  // The same by a clock that is 20 s off.
  const std::string align =
      "align in/swing --fps 8 --rig " + unregistered + " --out out/aligned.yaml --report out/align.html";
  ToolTest::expect_refused(align, {"--joints: is missing"});
  expect_done(align + " --joints " + in("later.csv", joints_by_clock(20 - clock_s)));
  EXPECT_NEAR(load_rig("out/aligned.yaml").instruments[0].image_delay_s.value(), clock_s - 20, 5e-3);
  expect_in(read_file("out/align.html"), "as the marker shows it");
  expect_done(
      "calibrate registration in/swing --fps 8 --rig out/aligned.yaml --out out/late.yaml --joints in/later.csv");
  EXPECT_NEAR(load_rig("out/late.yaml").instruments[0].image_delay_s.value(), clock_s - 20, 5e-3);

  // The same swing tests both rigs: the first has no calibration yet.
  const std::string check = "check in/swing --fps 8 --joints in/joints.csv --rig ";
  expect_done(check + "out/rig.yaml --out out/check.html");
  expect_in(output(), "\ngood enough\n  checked where yaw -0.");
  for (const char* figure : {"Rotation against encoder", "alt=\"Colours\""})
    expect_in(read_file("out/check.html"), figure);
  expect_failed(check + unregistered, {"not good enough: the rig has no camera_from_rcm"});
  EXPECT_EQ(run("check in/nothing --rig out/rig.yaml"), 2);

  // A refused calibration leaves the existing file.
  fs::create_directories("in/few");
  for (const char* name : {"0000.png", "0010.png", "0020.png"})
    fs::copy_file("in/swing/" + std::string(name), "in/few/" + std::string(name));
  const std::string written = read_file("out/rig.yaml");
  expect_failed("calibrate marker in/few --rig " + unregistered + " --out out/rig.yaml", {"film a slow full turn"});
  EXPECT_EQ(read_file("out/rig.yaml"), written);
  ToolTest::expect_refused(
      replaced(calibrate, "out/rig", "out/psm") + " --joints in/joints.csv --base-frame out/b.json",
      {"out/psm.yaml: joints.sign: is [1, -1, 1, -1]"});
  EXPECT_FALSE(fs::exists("out/psm.yaml"));

  // How well the tip is known, and by which part least, with readings of a wrist.
  const std::string with_tool = in("tool.yaml", read_file("out/rig.yaml") +
                                                    "    tool: {joints: [{name: wrist_pitch, alpha_rad: -1.5707963}], "
                                                    "tip_in_last_joint_m: [0.01, 0, 0], azimuth_rad: 0, "
                                                    "wrist_in_marker_m: [0, 0, 0.03], sigma_wrist_in_marker_m: "
                                                    "[0, 0, 0.00002]}\n");
  std::string with_wrist = std::regex_replace(joints, std::regex("\n"), ",0.3\n");
  with_wrist.replace(with_wrist.find(",0.3"), 4, ",wrist_pitch");
  expect_done("check in/swing --fps 8 --rig " + with_tool + " --out out/tip.html --joints " +
              in("with_wrist.csv", with_wrist));
  EXPECT_TRUE(std::regex_search(output(), std::regex("tip +known to 0\\.[0-9]+ mm: 0\\.17 from the wrist's joints, ")))
      << output();
  expect_in(read_file("out/tip.html"), "from the wrist");
  expect_done(check + with_tool);
  expect_in(output(), "unknown: no readings of the wrist's joints wrist_pitch");

  // Without joints: from what was tracked without a registration; with one, the axes would pass through it anyway.
  expect_done("track in/swing --rig " + unregistered + " --out out/free.csv");
  expect_done("calibrate registration out/free.csv --rig " + unregistered + " --out out/rcm.yaml");
  expect_in(output(), "is a convention");
  // A rig from a pipe, which can be read only once, gives the same.
  ASSERT_EQ(::mkfifo("in/pipe", 0600), 0);
  ASSERT_EQ(std::system(("cat " + unregistered + " >in/pipe &").c_str()), 0);
  expect_done("calibrate registration out/free.csv --rig in/pipe --out out/piped.yaml");
  EXPECT_EQ(read_file("out/piped.yaml"), read_file("out/rcm.yaml"));
  expect_done("track in/swing --rig out/rig.yaml --out out/bound.csv");
  expect_failed("calibrate registration out/bound.csv --rig out/rig.yaml --out out/no.yaml", {"camera_from_rcm"});
  EXPECT_FALSE(fs::exists("out/no.yaml"));
#ifdef LAPSERVO_TEST_BAGS
  write_bags_of("swing", fps, CsvTable::read("in/with_wrist.csv"));
  expect_tracked_as("out/bound.csv", "in/run.bag", "out/rig.yaml");
  // The loop over the same recording; what it decided is a run's log like any other.
  const std::string decide = "servo --replay in/run.bag --rig ";
  expect_done(decide + "out/rig.yaml --out out/decided");
  expect_in(output(), "72 images and the joints; nothing was sent");
  EXPECT_EQ(output().find("not_following"), std::string::npos) << output();
  // The rig's other instruments are tracked beside the one that is steered, which comes first.
  Rig two = load_rig("out/rig.yaml");
  Instrument& other = *two.instruments.insert(two.instruments.begin(), two.instruments[0]);
  other.name = "PSM2", other.marker.hues_deg = {210, 300, 60};
  expect_done(decide + in("two.yaml", rig_yaml(two)) + " --instrument PSM1 --out out/two");
  two = load_rig("out/two/rig.yaml");
  EXPECT_EQ(two.instruments[0].name + two.instruments.back().name, "PSM1PSM2");
  for (const std::string folder : {"decided", "two"}) expect_done("servo --replay out/" + folder + "/log.csv");
  // A goal of the tip needs the wrist as it was recorded.
  expect_done(decide + with_tool + " --tip 0.0371,-0.0006,0.1602");
  const CsvTable decided = CsvTable::read("out/decided/log.csv");
  ToolTest::expect_refused(decide + "configs/example.yaml", {"joints is missing"});
  ToolTest::expect_refused(decide + "out/rig.yaml --joint-topic /PSM2/measured_js", {"/PSM1/measured_js"});
  // An arm's clock that is wrong changes no decision.
  for (const double off_s : {-7.5, 2.0}) {
    write_bags_of("swing", fps, CsvTable::read("in/joints.csv"), off_s);
    expect_done(decide + "out/rig.yaml --force --out out/decided");
    expect_in(output(), off_s < 0 ? "the arm's clock is 7.50 s behind the camera's" : "2.00 s ahead of the camera's");
    const CsvTable log = CsvTable::read("out/decided/log.csv");
    ASSERT_EQ(log.rows(), decided.rows());
    for (std::size_t i = 0; i < log.rows(); ++i)
      EXPECT_EQ(log.text(i, "action") + log.text(i, "reason"), decided.text(i, "action") + decided.text(i, "reason"))
          << i;
  }
  // The same as a session of dvrk_data, through H.264.
  write_bags_of("swing", fps, CsvTable::read("in/joints.csv"));
  write_session_of("swing", fps);
  const std::string session = "in/session --eye right --rig ";
  ToolTest::expect_refused("track in/session --rig out/rig.yaml --out out/no.csv",
                           {"--eye: is missing, expected left or right: in/session has both eyes side by side (RL)"});
  expect_done("calibrate registration " + session + unregistered + " --out out/session.yaml");
  const Instrument of_session = load_rig("out/session.yaml").instruments[0];
  EXPECT_EQ(of_session.joints->sign, found.joints->sign);
  EXPECT_NEAR(of_session.image_delay_s.value(), clock_s, 5e-3);
  EXPECT_LE((of_session.camera_from_rcm->translation - found.camera_from_rcm->translation).norm(), 1e-3);
  expect_done("servo --replay " + session + "out/session.yaml --out out/of_session");
  expect_in(output(), "72 images and the joints; nothing was sent");
#endif
}

TEST_F(CommandLine, CalibratesACamera) {
  const Camera camera{640, 480, 612.5, 612.5, 326.2, 233.1, {}, {Response::Kind::rec709}};
  fs::create_directories("in/boards");
  int number = 0;
  for (const Rigid3& pose : board_poses({}, camera, 5, 3))
    cv::imwrite("in/boards/" + std::to_string(number++) + ".png", render_board({}, camera, pose, 7));
  cv::imwrite("in/boards/9.png", cv::Mat(480, 640, CV_8UC3, cv::Scalar(90, 90, 90)));
  const std::string example = read_file("configs/example.yaml");
  const std::string rig =
      in("rig.yaml",
         "camera: {image_width: 640, image_height: 480, camera_matrix: {data: [600, 0, 320, 0, 600, 240, 0, 0, 1]}}\n" +
             example.substr(example.find("instruments")));
  const std::string board = " --board 9x6 --square-mm 5", before = read_file(rig);
  // Too few, and none: the rig is as it was.
  expect_failed("calibrate camera in/boards/0.png" + board + " --rig " + rig, {"3 more views"});
  expect_failed("calibrate camera in/boards/9.png" + board + " --rig " + rig, {"in none of 1 images"});
  EXPECT_EQ(read_file(rig), before);

  expect_done("calibrate camera in/boards" + board + " --rig " + rig + " --camera-info out/camera.yaml");
  expect_in(output(), "response: rec709");
  expect_in(output(), "there is no board: in/boards/9.png");
  for (const std::string& text : {read_file(rig), read_file("out/camera.yaml")})
    for (const char* key : {"sigma_camera_matrix", "sigma_distortion_coefficients", "response: rec709",
                            "sigma_lateral_chromatic_aberration"})
      expect_in(text, key);
}

// Without a recording there is nothing to do, and a rig that somebody edits is another.
TEST_F(CommandLine, CalibrateAllSaysWhatItDidNot) {
  const std::string start = "calibrate all --no-questions --rig " + in("mine.yaml", read_file("configs/example.yaml"));
  expect_done(start);
  expect_in(output(), "camera: left out; --boards names");
  EXPECT_FALSE(fs::exists("in/mine.calibration.yaml"));
  in("mine.calibration.yaml", "rig: another\nsteps:\n  - {name: camera, command: a, inputs: b, when: 2026}\n");
  expect_done(start);
  expect_in(output(), "mine.yaml is not as the last step left it");
  write_grey("in/grey.png");
  expect_refused(start + " --boards in/grey.png", {"needs --board and --square-mm"});
  expect_refused(start + " --redo marker", {"--redo: marker needs --turn"});
  expect_refused(start + " --joint-topic /x --turn in/grey.png", {"--joint-topic: is /x, which is for bags"});
  expect_refused(start + " --report page.yaml", {"page.yaml", ".html"});
  expect_refused(start + " --turn /dev/video0", {"expected a folder with files"});
  ASSERT_EQ(::mkfifo("in/pipe", 0600), 0);  // it must not even be read: nobody writes into this one
  expect_refused("calibrate all --no-questions --rig in/pipe",
                 {"pipe: is a pipe or a device", "each step replaces it"});
}

// Though the check was done.
TEST_F(CommandLine, CalibrateAllWritesAPageThatIsNotThere) {
  const std::string rig = in("mine.yaml", read_file("configs/example.yaml"));
  write_grey("in/grey.png");
  write_record(
      "in/mine.calibration.yaml",
      {rig_state(rig),
       {{"check", "lapservo check in/grey.png --rig in/mine.yaml --fps 30", input_state("in/grey.png"), "2026"}}});
  const std::string all = "calibrate all --no-questions --check in/grey.png --rig " + rig;
  expect_done(all);
  expect_in(output(), "check: done on 2026");
  EXPECT_EQ(run(all + " --report out/check.html"), 1);
  EXPECT_TRUE(fs::exists("out/check.html"));
  EXPECT_EQ(errors().find("goes on"), std::string::npos) << "the verdict is no stop";
}

// On a terminal, the check's recording is another than the swing, which is left out.
TEST_F(CommandLine, CalibrateAllTakesTheSwingsJointsForNoOtherRecording) {
  const std::string all =
      LAPSERVO_TOOL " calibrate all --joints in/joints.csv --rig " + in("mine.yaml", read_file("configs/example.yaml"));
  write_grey("in/grey.png");
  ASSERT_EQ(
      std::system(("printf '\\n\\n\\n\\nin/grey.png\\n\\n' | script -qec '" + all + "' /dev/null >stdout").c_str()),
      1 << 8);
  expect_in(output(), "lapservo check in/grey.png --rig in/mine.yaml --fps 30");
}

TEST_F(CommandLine, CalibrationsAndRecordingsRefuseWhatTheyWouldIgnore) {
  in("kept", "");
  expect_refused("sample in", {"in: is not empty, expected a new or an empty folder"});
  const std::string to = " --rig configs/example.yaml --out out/rig.yaml";
  expect_refused("calibrate registration in/seen.csv --fps 8" + to, {"--fps: is of frames", "a CSV"});
  const std::string table = "calibrate registration " + in("seen.csv", "time_s\n") + to;
  for (const std::string idle : {"--endoscope ros2:ECM", "--reference-frame camera"})
    expect_refused(table + " " + idle, {idle.substr(0, idle.find(' ')), "expected --base-frame"});
  expect_refused(table + " --endoscope ros2:ECM --base-frame out/base.json --reference-frame camera",
                 {"--reference-frame", "expected none with --endoscope"});
  for (const std::string of_joints : {"--set-base-frame ros2:PSM1", "--base-frame out/base.json"})
    expect_refused(table + " " + of_joints, {of_joints.substr(0, of_joints.find(' ')) + ": needs the arm's joints"});
  expect_refused("calibrate tip --calliper 20 --eye left" + to, {"--eye", "--pivot"});
  expect_refused("calibrate tip --calliper 20 --deinterlace" + to, {"--deinterlace", "--touch"});
  expect_refused("calibrate tip --pivot in/tip --board 9x6" + to, {"--board", "--touch"});
  expect_refused("calibrate tip --calliper 20 --joint-topic /js" + to, {"--joint-topic", "--pivot"});
  const std::string record = "record --camera ros2:/image --out out/bag ";
  for (const std::string idle : {"--instrument PSM1", "--scale 3", "--setpoint-readers 2", "--enable-motion"})
    expect_refused(record + idle, {idle.substr(0, idle.find(' ')), "expected --move"});
  expect_refused(record + "--joint-limits configs/joint_limits/psm-si.yaml", {"--joint-limits", "expected --move"});
  for (const std::string idle : {"--scale 3", "--duration 9"})
    expect_refused(record + "--move turn " + idle, {idle.substr(0, idle.find(' ')), "expected --move swing"});
}

TEST_F(CommandLine, CalibrateCameraRefusesBadInput) {
  cv::imwrite("in/large.png", cv::Mat(90, 160, CV_8UC3, cv::Scalar(20, 20, 20)));
  cv::imwrite("in/small.png", cv::Mat(80, 160, CV_8UC3, cv::Scalar(20, 20, 20)));
  const std::string to = " --out out/camera.yaml", board = " --board 9x6 --square-mm 5";
  const std::string calibrate = "calibrate camera in/large.png";
  expect_refused(calibrate + " --square-mm 5 --board 9by6" + to, {"--board", "9by6", "inner corners"});
  expect_refused(calibrate + " --square-mm 0 --board 9x6" + to, {"--square-mm"});
  expect_refused(calibrate + board, {"--rig, --out or --camera-info"});
  expect_refused(calibrate + " in/small.png" + board + to, {"small.png", "160 x 80", "160 x 90", "large.png"});
  expect_refused(calibrate + board + " --rig configs/example.yaml", {"large.png", "160 x 90", "the rig's camera"});
  expect_refused(calibrate + board + to + " --aruco DICT_9", {"--aruco", "DICT_9", "DICT_4X4_50"});
  expect_refused(calibrate + board + to + " --marker-mm 3", {"--marker-mm", "--aruco"});
  expect_refused(calibrate + board + to + " --camera-info out/camera.yaml", {"camera.yaml", "two results"});
  expect_refused(calibrate + board + " --out in/large.png", {"large.png", "input itself"});
}

}  // namespace lapservo::internal::command_line_test
