// The tool as its user meets it: exit codes, one line per complaint, nothing left half-written.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <string>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "lapservo/core/csv.h"
#include "lapservo/testing/boards.h"
#include "lapservo/testing/sample_frames.h"
#ifdef LAPSERVO_TEST_BAGS
#include <fmt/format.h>

#include "recordings/test_bags.h"
#endif

namespace lapservo {
using namespace internal;
namespace {
namespace fs = std::filesystem;

std::string read(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

class CommandLine : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("lapservo_cli_" + std::to_string(::getpid()) +
                                           ::testing::UnitTest::GetInstance()->current_test_info()->name());
    // OpenCV's video backends, loaded for a try and unloaded again, keep what they allocated.
    ::setenv("ASAN_OPTIONS", "detect_leaks=0", 1);
    fs::create_directories(folder_ / "in");
    fs::create_directories(folder_ / "out");
  }
  void TearDown() override { fs::remove_all(folder_); }

  int run(const std::string& arguments) {
    const std::string command = std::string(LAPSERVO_TOOL) + " " + arguments + " >" + (folder_ / "stdout").string() +
                                " 2>" + (folder_ / "stderr").string() + " </dev/null";
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string errors() const { return read(folder_ / "stderr"); }
  std::string output() const { return read(folder_ / "stdout"); }

  // Exit code 2, one line that holds all the words, nothing in out/.
  void expect_refused(const std::string& arguments, std::initializer_list<const char*> words) {
    SCOPED_TRACE(arguments);
    EXPECT_EQ(run(arguments), 2);
    const std::string text = errors();
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
    for (const char* word : words) EXPECT_NE(text.find(word), std::string::npos) << "no '" << word << "' in: " << text;
    EXPECT_TRUE(fs::is_empty(folder_ / "out")) << "left something behind";
  }
  std::string in(const std::string& name, const std::string& content = "") {
    const fs::path path = folder_ / "in" / name;
    if (!content.empty()) std::ofstream(path, std::ios::binary) << content;
    return path.string();
  }
  std::string out(const std::string& name) const { return (folder_ / "out" / name).string(); }
  std::string track(const std::string& input) const {
    return "track " + input + " --rig " + rig_ + " --out " + out("obs.csv") + " --overlay " + out("overlay");
  }

#ifdef LAPSERVO_TEST_BAGS
  // in/run.bag and in/run, a bag of ROS 2: a folder's pictures as PNG, and joints by the same clock.
  void write_bags_of(const std::string& pictures, double fps, const CsvTable& joints) {
    constexpr double begin_s = 1700000000;
    std::vector<lapservo::testing::BagEntry> ros1, ros2;
    const auto add = [&](const char* topic, const char* type, const auto& message) {
      ros1.push_back({topic, type, message.stamp_s, lapservo::testing::ros1_bytes(message)});
      ros2.push_back({topic, type, message.stamp_s, lapservo::testing::cdr_bytes(message)});
    };
    JointMessage reading{0, {"wrist"}, {0}};
    for (const std::string& name : joints.columns())
      if (name != "time_s") reading.names.push_back(name);
    for (std::size_t row = 0; row < joints.rows(); ++row) {
      reading.stamp_s = begin_s + joints.number(row, "time_s");
      reading.positions = {7};
      for (std::size_t i = 1; i < reading.names.size(); ++i)
        reading.positions.push_back(joints.number(row, reading.names[i]));
      add("/PSM1/measured_js", "sensor_msgs/JointState", reading);
    }
    for (int i = 0; fs::exists(in(pictures) + fmt::format("/{:04}.png", i)); ++i) {
      const std::string png = read(in(pictures) + fmt::format("/{:04}.png", i));
      add("/endoscope/image_raw/compressed", "sensor_msgs/CompressedImage",
          CompressedImageMessage{begin_s + i / fps, "png", {png.begin(), png.end()}});
    }
    lapservo::testing::write_ros1_bag(in("run.bag"), ros1, "lz4");
    fs::create_directories(in("run"));
    lapservo::testing::write_ros2_bag(in("run") + "/run_0.db3", ros2);
    lapservo::testing::write_ros2_metadata(in("run"), {"run_0.db3"});
  }
  // Every number as in a run on the pictures themselves, but for the last digits of times.
  void expect_tracked_as(const std::string& observations, const std::string& bag, const std::string& rig) {
    ASSERT_EQ(run("track " + bag + " --fps 8 --rig " + rig + " --out " + out("bag.csv")), 0) << errors();
    const CsvTable expected = CsvTable::read(observations), found = CsvTable::read(out("bag.csv"));
    ASSERT_EQ(found.rows(), expected.rows());
    for (std::size_t row = 0; row < found.rows(); ++row)
      for (const std::string& column : expected.columns())
        if (column == "time_s") {
          EXPECT_NEAR(found.number(row, column), static_cast<double>(row) / 8, 1e-6);
        } else if (column != "file") {
          EXPECT_EQ(found.text(row, column), expected.text(row, column)) << column;
        }
  }
  // Two rigs' measured numbers, of times that differ in their last digits.
  static void expect_same_numbers(const std::string& one, const std::string& other) {
    const auto words_of = [](const std::string& text) {
      std::istringstream from(text);
      return std::vector<std::string>(std::istream_iterator<std::string>(from), {});
    };
    const auto a = words_of(one), b = words_of(other);
    ASSERT_EQ(a.size(), b.size());
    const auto number = [](const std::string& word) {
      const std::size_t at = word.find_first_of("-0123456789");
      return at == std::string::npos ? std::nullopt : std::optional(std::stod(word.substr(at)));
    };
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (a[i] == b[i]) continue;
      EXPECT_NEAR(number(a[i]).value(), number(b[i]).value(), 1e-5) << a[i] << " " << b[i];
    }
  }
#endif

  fs::path folder_;
  const std::string rig_ = lapservo::testing::source_folder().string() + "/configs/example.yaml";
};

TEST_F(CommandLine, RenderThenTrack) {
  ASSERT_EQ(run("render --rig " + rig_ + " --out " + out("frames") + " --count 3 --seed 5"), 0) << errors();
  for (const char* name : {"0000.png", "0002.png", "truth.csv", "rig.yaml"})
    EXPECT_TRUE(fs::exists(out("frames") + "/" + name));
  ASSERT_EQ(run("track " + out("frames") + " --out " + out("obs.csv") + " --overlay " + out("overlay")), 0) << errors();
  const CsvTable observed = CsvTable::read(out("obs.csv")), truth = CsvTable::read(out("frames") + "/truth.csv");
  ASSERT_EQ(observed.rows(), 3U);
  for (std::size_t row = 0; row < 3; ++row) {
    EXPECT_EQ(observed.text(row, "status"), "ok");
    EXPECT_EQ(observed.text(row, "file"), truth.text(row, "file"));
    EXPECT_NEAR(observed.number(row, "l_px"), truth.number(row, "l_px"), 0.2);
    EXPECT_TRUE(fs::exists(out("overlay") + "/" + truth.text(row, "file")));
  }
}

// Of such a print nothing is told but what to do.
TEST_F(CommandLine, SaysWhatToDoAboutAPrintThatIsOff) {
  std::string printed = read(rig_);
  for (const auto& [of_rig, off] :
       {std::pair<std::string, std::string>{"[0.0035, 0.0035, 0.017]", "[0.0037, 0.0035, 0.0168]"},
        {"[0.0095, 0.0095, 0.005]", "[0.0097, 0.0095, 0.0048]"}}) {
    ASSERT_NE(printed.find(of_rig), std::string::npos);
    printed.replace(printed.find(of_rig), of_rig.size(), off);
  }
  std::ofstream(out("printed.yaml")) << printed;
  ASSERT_EQ(run("render --rig " + out("printed.yaml") + " --out " + out("frames") + " --count 2 --seed 5"), 0)
      << errors();
  EXPECT_EQ(run("track " + out("frames") + " --rig " + rig_ + " --out " + out("obs.csv")), 1);
  EXPECT_NE(errors().find("in 2 of 2 frames the print is not as the rig says (marker_mismatch)"), std::string::npos)
      << errors();
  EXPECT_NE(errors().find("lapservo calibrate marker"), std::string::npos) << errors();
  EXPECT_EQ(CsvTable::read(out("obs.csv")).text(0, "status"), "marker_mismatch");
}

TEST_F(CommandLine, VideosAndTheBaseline) {
  ASSERT_EQ(run("render --rig " + rig_ + " --out " + out("film") + " --count 6 --moving --video"), 0) << errors();
  ASSERT_EQ(run("track " + out("film") + "/video.mp4 --out " + out("obs.csv") + " --overlay " + out("overlay.mp4")), 0)
      << errors();
  EXPECT_EQ(CsvTable::read(out("obs.csv")).rows(), 6U);
  EXPECT_GT(fs::file_size(out("overlay.mp4")), 1000U);
  ASSERT_EQ(run("track " + out("film") + "/video.mp4 --method centerline --out " + out("c.csv")), 0) << errors();
}

#ifdef LAPSERVO_GST
// Live, they are measured as from files; each frame that is not taken is counted.
TEST_F(CommandLine, GStreamersPipelinesAreTracked) {
  ASSERT_EQ(run("render --rig " + rig_ + " --out " + out("frames") + " --count 3 --seed 5"), 0) << errors();
  std::string raw;
  for (const char* name : {"/0000.png", "/0001.png", "/0002.png"}) {
    const cv::Mat picture = cv::imread(out("frames") + name);
    raw.append(reinterpret_cast<const char*>(picture.data), picture.total() * picture.elemSize());
  }
  const std::string pipeline = "'gst:filesrc location=" + in("frames.raw", raw) +
                               " ! rawvideoparse format=bgr width=1280 height=720 framerate=1/1'";
  ASSERT_EQ(run("track " + out("frames") + " --rig " + rig_ + " --single --out " + out("files.csv")), 0) << errors();
  ASSERT_EQ(run("track " + pipeline + " --rig " + rig_ + " --single --out " + out("live.csv")), 0) << errors();
  const CsvTable files = CsvTable::read(out("files.csv")), live = CsvTable::read(out("live.csv"));
  ASSERT_EQ(live.rows(), 3U) << output();
  for (std::size_t row = 0; row < 3; ++row) {
    EXPECT_NEAR(live.number(row, "time_s"), static_cast<double>(row), 1e-4);
    EXPECT_EQ(live.text(row, "psi_rad"), files.text(row, "psi_rad"));
  }
  EXPECT_EQ(run("track " + pipeline + " --rig " + rig_ + " --frames 1 --out " + out("live.csv")), 0) << errors();
  EXPECT_EQ(CsvTable::read(out("live.csv")).rows(), 1U);
  fs::remove_all(folder_ / "out");
  fs::create_directories(folder_ / "out");
  expect_refused(track("gst:nosuchelement"), {"gst:nosuchelement", "nosuchelement", "expected a pipeline"});
  expect_refused("track gst:videotestsrc --out " + out("obs.csv"), {"--rig", "is missing"});
}
#endif

TEST_F(CommandLine, BagsThatCannotBeRead) {
  for (const auto& [name, content, what] : {std::array{"new.mcap", "\x89MCAP0", "ros2 bag convert"},
                                            {"packed.db3.zstd", "(\xb5/\xfd", "zstd -d"},
                                            {"run.bag", "#ROSBAG V2.0\n", "ROS 1 bag"},
                                            {"run.db3", "SQLite format 3", "ROS 2 bag"}}) {
    expect_refused(track(in(name, content)), {name, what});
  }
  expect_refused("servo --replay " + in("run.bag"), {"--rig", "is missing"});
  expect_refused("servo --replay " + in("run.bag") + " --rig " + rig_, {"run.bag", "ROS 1 bag"});
  expect_refused("calibrate registration " + in("run.db3") + " --rig " + rig_ + " --out " + out("rig.yaml"),
                 {"run.db3", "ROS 2 bag"});
  expect_refused("track " + in("picture.png", "?") + " --image-topic /image --out " + out("obs.csv"),
                 {"--image-topic", "is /image, which is for bags"});
  expect_refused("calibrate registration " + in("obs.csv", "a\n") + " --joint-topic /joints --rig " + rig_ + " --out " +
                     out("rig.yaml"),
                 {"--joint-topic", "is /joints, which is for bags"});
}

TEST_F(CommandLine, CamerasThatAreNone) {
  const std::string servo = "servo --rig " + lapservo::testing::source_folder().string() +
                            "/configs/paper.yaml --robot ros2:PSM1 --out " + out("run") + " --camera ";
  expect_refused(servo + "/dev/video-none", {"/dev/video-none", "can't be opened", "expected a camera"});
  expect_refused(servo + "video.mp4", {"--camera", "is video.mp4", "/dev/videoN"});
  expect_refused(servo + "''", {"--camera", "is missing", "ros2:/topic"});
}

#ifdef LAPSERVO_WEB
TEST_F(CommandLine, PagesThatCanNotBeServed) {
  cv::imwrite(in("grey.png"), cv::Mat(720, 1280, CV_8UC3, cv::Scalar(90, 90, 90)));
  const std::string picture = in("grey.png") + " --rig " + rig_ + " ";
  const std::string track = "track " + picture + "--out " + out("obs.csv") + " ";
  expect_refused(track + "--listen 0.0.0.0", {"--listen", "expected --web"});
  expect_refused("servo --robot sim --rig " + rig_ + " --listen 0.0.0.0", {"--listen", "expected --web"});
  expect_refused(track + "--web 65536", {"--web", "65536"});
  expect_refused(track + "--web 0 --listen robot.example", {"--listen", "robot.example", "an address"});
  expect_refused("view " + picture + "--port 0 --listen 192.0.2.1", {"--port", "192.0.2.1"});  // nobody's
}
#endif

TEST_F(CommandLine, NothingFoundIsOne) {
  cv::imwrite(in("grey.png"), cv::Mat(720, 1280, CV_8UC3, cv::Scalar(90, 90, 90)));
  EXPECT_EQ(run("track " + in("grey.png") + " --rig " + rig_ + " --out " + out("obs.csv")), 1);
  EXPECT_EQ(CsvTable::read(out("obs.csv")).text(0, "status"), "no_marker");
}

TEST_F(CommandLine, PicturesThatAreNone) {
  cv::Mat noise(720, 1280, CV_8UC3);
  cv::randu(noise, 0, 255);
  cv::imwrite(in("whole.png"), noise);
  cv::imwrite(in("whole.jpg"), noise);
  cv::imwrite(in("small.png"), noise(cv::Rect(0, 0, 960, 540)));
  const std::string png = read(in("whole.png")), jpg = read(in("whole.jpg"));
  expect_refused(track(in("missing.png")), {"missing.png", "does not exist"});
  expect_refused(track(in("half.png", png.substr(0, png.size() / 2))), {"half.png", "truncated"});
  expect_refused(track(in("half.jpg", jpg.substr(0, jpg.size() / 2))), {"half.jpg", "truncated"});
  expect_refused(track(in("text.png", "this is no picture")), {"text.png", "expected a picture"});
  expect_refused(track(in("film.mp4", "this is no film")), {"film.mp4", "expected"});
  expect_refused(track(in("small.png")), {"small.png", "960x540", "1280x720"});
  std::ofstream(in("empty.png"));
  expect_refused(track(in("empty.png")), {"empty.png", "is empty"});
  fs::create_directories(folder_ / "in/folder");
  expect_refused(track(in("folder")), {"folder", "no pictures"});
}

TEST_F(CommandLine, GreyDeepAndTransparentPicturesAreAccepted) {
  cv::imwrite(in("grey.png"), cv::Mat(720, 1280, CV_8UC1, cv::Scalar(90)));
  cv::imwrite(in("deep.png"), cv::Mat(720, 1280, CV_16UC3, cv::Scalar(9000, 9000, 9000)));
  cv::imwrite(in("alpha.png"), cv::Mat(720, 1280, CV_8UC4, cv::Scalar(90, 90, 90, 10)));
  for (const char* name : {"grey.png", "deep.png", "alpha.png"})
    EXPECT_EQ(run("track " + in(name) + " --rig " + rig_ + " --out " + out("obs.csv")), 1) << name;
}

TEST_F(CommandLine, RigsThatAreNone) {
  cv::imwrite(in("grey.png"), cv::Mat(720, 1280, CV_8UC3, cv::Scalar(90, 90, 90)));
  const std::string good = read(rig_);
  const auto with = [&](const std::string& what, const std::string& instead) {
    std::string text = good;
    text.replace(text.find(what), what.size(), instead);
    return "track " + in("grey.png") + " --rig " + in("rig.yaml", text) + " --out " + out("obs.csv");
  };
  expect_refused("track " + in("grey.png") + " --rig " + in("none.yaml") + " --out " + out("obs.csv"), {"none.yaml"});
  expect_refused(with("diameter_m: 0.0084", "diameter_m: -1"), {"rig.yaml", "diameter_m", "-1"});
  expect_refused(with("diameter_m: 0.0084", "diameter_m: .nan"), {"rig.yaml", "diameter_m", ".nan"});
  expect_refused(with("diameter_m: 0.0084", "diameter: 0.0084"),
                 {"rig.yaml", "marker.diameter", "unknown", "diameter_m"});
  expect_refused(with("image_width: 1280", "image_width: wide"), {"rig.yaml", "image_width", "wide"});
  expect_refused(with("[0.0095, 0.0095, 0.005]", "[0.0035, 0.0035, 0.017]"), {"rig.yaml", "marker", "decodable"});
  expect_refused(with("camera:", "[[[[["), {"rig.yaml"});
}

TEST_F(CommandLine, OutputsThatCannotBe) {
  cv::imwrite(in("grey.png"), cv::Mat(720, 1280, CV_8UC3, cv::Scalar(90, 90, 90)));
  expect_refused("track " + in("grey.png") + " --rig " + rig_ + " --out " + out("no/such/folder/obs.csv"),
                 {"obs.csv", "can't be written"});
  expect_refused("track " + in("grey.png") + " --rig " + rig_ + " --out " + in("grey.png"),
                 {"grey.png", "the input itself"});
  expect_refused("track " + in("grey.png") + " --rig " + rig_ + " --method guess --out " + out("obs.csv"), {"guess"});
  unsetenv("DISPLAY");
  unsetenv("WAYLAND_DISPLAY");
  expect_refused("track " + in("grey.png") + " --rig " + rig_ + " --view --out " + out("obs.csv"),
                 {"--view", "display"});
}

TEST_F(CommandLine, RenderingWhatCannotBe) {
  std::string text = read(rig_);
  text.erase(text.find("    camera_from_rcm"));
  expect_refused("render --rig " + in("free.yaml", text) + " --out " + out("frames"),
                 {"free.yaml", "camera_from_rcm", "missing"});
  expect_refused("render --rig " + rig_ + " --poses " + in("q.csv", "theta_rad,phi_rad,rho_m,psi_rad\n0,1.5,nan,0\n") +
                     " --out " + out("frames"),
                 {"q.csv", "rho_m", "nan"});
}

TEST_F(CommandLine, Markers) {
  EXPECT_EQ(run("marker design --diameter-mm 8.4 --out " + out("marker.yaml")), 0) << errors();
  EXPECT_NE(read(out("marker.yaml")).find("bands_upper_m"), std::string::npos);
  for (const char* name : {"sheet.pdf", "sheet.svg"}) {
    EXPECT_EQ(run("marker print --rig " + rig_ + " --out " + out(name)), 0) << errors();
    EXPECT_GT(fs::file_size(out(name)), 1000U);
  }
  EXPECT_EQ(run("marker show --rig " + rig_ + " --out " + out("marker.png")), 0) << errors();
  EXPECT_NE(output().find("222"), std::string::npos);
  fs::remove_all(folder_ / "out");
  fs::create_directories(folder_ / "out");
  expect_refused("marker design --bands-upper-mm 5,5,10 --bands-lower-mm 10,5,5", {"not decodable"});
  expect_refused("marker design --diameter-mm 8 --length-mm 8", {"do not fit"});
  expect_refused("marker print --rig " + rig_ + " --out " + out("sheet.txt"), {"sheet.txt"});
  expect_refused("marker show --rig " + rig_ + " --instrument PSM9", {"PSM9"});
}

TEST_F(CommandLine, ServoRunsAndReplays) {
  const std::string paper = lapservo::testing::source_folder().string() + "/configs/paper.yaml";
  ASSERT_EQ(run("servo --rig " + paper + " --robot sim --duration 6 --seed 2 --out " + out("run")), 0) << errors();
  EXPECT_NE(output().find("within 1 px and 5 mrad from"), std::string::npos) << output();
  for (const char* name : {"log.csv", "rig.yaml", "controller.yaml"}) EXPECT_TRUE(fs::exists(out("run") + "/" + name));
  EXPECT_EQ(CsvTable::read(out("run") + "/log.csv").rows(), 360U);
  EXPECT_EQ(run("servo --replay " + out("run") + "/log.csv"), 0) << errors();
  EXPECT_NE(output().find("360 ticks reproduced bit for bit"), std::string::npos) << output();

  const std::string controller = read(out("run") + "/controller.yaml");
  std::ofstream(out("run") + "/controller.yaml")
      << "gains_per_s: [4, 5, 5, 5]\n"
      << controller.substr(0, controller.find("gains")) << controller.substr(controller.find("delay_s"));
  EXPECT_EQ(run("servo --replay " + out("run") + "/log.csv"), 1);
  EXPECT_NE(errors().find("tick"), std::string::npos);
  // It has not converged after half a second.
  EXPECT_EQ(run("servo --rig " + paper + " --robot sim --duration 0.5"), 1);
  // It converges, and then ends in a hold.
  EXPECT_EQ(run("servo --rig " + paper + " --robot sim --duration 4.5 --seed 2 --hide 4,9"), 1);
  EXPECT_NE(output().find("within 1 px and 5 mrad from"), std::string::npos) << output();
  EXPECT_NE(output().find("ended in a hold: marker_lost"), std::string::npos) << output();
}

// Section V-D, to the letter: omega is 0.5 rad/s for all features, K holds per control period (60 a second).
TEST_F(CommandLine, ServoByThePapersMethod) {
  const std::string paper = lapservo::testing::source_folder().string() + "/configs/paper.yaml";
  EXPECT_EQ(
      run("servo --method paper --rig " + paper + " --robot sim --trajectory paper --duration 3 --out " + out("run")),
      1);
  EXPECT_NE(output().find("Algorithm 1"), std::string::npos) << output();
  const CsvTable log = CsvTable::read(out("run") + "/log.csv");
  ASSERT_EQ(log.rows(), 180U);
  const double start_s = log.number(0, "time_s");
  for (std::size_t row = 0; row < log.rows(); ++row) {
    const double swing = std::sin(0.5 * (log.number(row, "time_s") - start_s));
    EXPECT_NEAR(log.number(row, "desired_s_rad"), 0.9 + 0.05 * swing, 1e-9);
    EXPECT_NEAR(log.number(row, "desired_r_px"), 795 + 60 * swing, 1e-9);
    EXPECT_NEAR(log.number(row, "desired_l_px"), 365 + 30 * swing, 1e-9);
    EXPECT_NEAR(log.number(row, "desired_d_px"), 212 + 37 * swing, 1e-9);
  }
  const std::string controller = read(out("run") + "/controller.yaml");
  double s = 0, r = 0, l = 0, d = 0;
  ASSERT_EQ(std::sscanf(controller.c_str() + controller.find("gains_per_s"), "gains_per_s: [%lf, %lf, %lf, %lf]", &s,
                        &r, &l, &d),
            4)
      << controller;
  const std::array<double, 4> per_period{s / 60, r / 60, l / 60, d / 60}, papers{0.032, 0.008, 0.0008, 0.01};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(per_period.at(i), papers.at(i), 1e-12) << i;

  run("servo --method paper --tracker surface --rig " + paper + " --robot sim --duration 0.5");
  EXPECT_NE(output().find("all visible lines"), std::string::npos) << output();
}

// A number is the whole text, finite and in its range, for every option of every subcommand.
TEST_F(CommandLine, NumbersThatAreNone) {
  const std::string frames = "render --rig " + rig_ + " --out " + out("frames"), design = "marker design",
                    servo = "servo --rig " + rig_ + " --robot sim --out " + out("run"),
                    estimate = "estimate-rcm " + in("obs.csv", "instrument,status\n") + " --out " + out("rcm.csv");
  const std::vector<std::pair<std::string, std::vector<const char*>>> options{
      {frames, {"count", "seed", "light", "smoke", "blood", "noise", "blur-px", "motion", "film-mm", "fps"}},
      {design, {"diameter-mm", "length-mm", "smallest-band-mm", "focal-px", "distance-mm", "sigma-px"}},
      {"marker print --rig " + rig_ + " --out " + out("sheet.pdf"), {"copies"}},
      {"marker show --rig " + rig_, {"focal-px", "distance-mm", "sigma-px"}},
      {servo, {"duration", "latency-ms", "fps", "seed"}},
      {estimate, {"sigma-px", "common-px"}},
      {"experiment rcm --out " + out("report"), {"seed"}},
      {track(in("none.png")), {"fps"}}};
  for (const auto& [command, names] : options)
    for (const char* name : names)
      for (const char* value : {"nan", "-1", "1x"})
        expect_refused(command + " --" + name + " " + value, {name, "expected"});
  for (const char* list : {"start 0,1.5,nan,0", "start 0,1.5,0.1,1e999", "set-point nan,795,365,212", "via 1,2,x,4",
                           "rcm-px nan,1", "hide 1,inf"})
    expect_refused(servo + " --" + list,
                   {std::string(list).substr(0, std::string(list).find(' ')).c_str(), "expected"});
  for (const char* value : {"1.5", "18446744073709551617", "9007199254740993"})
    expect_refused(frames + " --seed " + value, {"--seed", value, "whole number"});
  expect_refused(frames + " --count 1.5", {"--count", "1.5"});
}

// A flipped bit that the decoder notices, a picture of a palette, one that is to be turned: never a row that is ok.
TEST_F(CommandLine, FlawedPicturesHaveAWordOfTheirOwn) {
  ASSERT_EQ(run("render --rig " + rig_ + " --out " + out("frames") + " --count 1 --seed 5 --format jpg"), 0)
      << errors();
  const std::string whole = read(out("frames") + "/0000.jpg");
  std::string damaged = whole;
  damaged.erase(damaged.size() / 2, 300);
  cv::Mat few = cv::imread(out("frames") + "/0000.jpg");
  few &= cv::Scalar(0xc0, 0xc0, 0xc0);
  cv::imwrite(in("few.png"), few);
  for (const auto& [file, word] : {std::pair{in("damaged.jpg", damaged), "damaged"}, {in("few.png"), "few_colors"}}) {
    EXPECT_EQ(run("track " + file + " --rig " + rig_ + " --out " + out("obs.csv")), 1);
    EXPECT_EQ(CsvTable::read(out("obs.csv")).text(0, "status"), word);
  }
  EXPECT_EQ(run("track " + in("whole.jpg", whole) + " --rig " + rig_ + " --out " + out("obs.csv")), 0) << errors();
}

TEST_F(CommandLine, AVideoThatEndsEarlyIsMeasuredAndSaysSo) {
  ASSERT_EQ(run("render --rig " + rig_ + " --out " + out("film") + " --count 12 --moving"), 0) << errors();
  cv::VideoWriter video(in("a.mkv"), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('m', 'p', '4', 'v'), 25, {1280, 720});
  for (int i = 0; i < 12; ++i)
    video.write(cv::imread(out("film") + (i < 10 ? "/000" : "/00") + std::to_string(i) + ".png"));
  video.release();
  const std::string whole = read(in("a.mkv"));
  const std::string half = in("half.mkv", whole.substr(0, whole.size() / 2));
  EXPECT_EQ(run("track " + half + " --rig " + rig_ + " --out " + out("obs.csv")), 1);
  EXPECT_NE(errors().find("half.mkv: ends early"), std::string::npos) << errors();
  const std::string said = errors();
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
  const std::size_t rows = CsvTable::read(out("obs.csv")).rows();
  EXPECT_GE(rows, 3U);
  EXPECT_LT(rows, 12U);
}

TEST_F(CommandLine, ANameWithALineEndIsQuoted) {
  fs::create_directories(folder_ / "in/folder");
  cv::imwrite((folder_ / "in/folder/a.png").string(), cv::Mat(720, 1280, CV_8UC3, cv::Scalar(90, 90, 90)));
  fs::rename(folder_ / "in/folder/a.png", folder_ / "in/folder/a\nb.png");
  EXPECT_EQ(run("track " + in("folder") + " --rig " + rig_ + " --out " + out("obs.csv")), 1);
  EXPECT_EQ(CsvTable::read(out("obs.csv")).text(0, "file"), "a\nb.png");
}

TEST_F(CommandLine, WhatHasNoEndIsRefused) {
  fs::create_symlink("/dev/zero", in("endless.png"));
  expect_refused(track(in("endless.png")), {"endless.png", "larger than 256 MiB"});
  std::ofstream(in("sparse.png")) << "x";
  fs::resize_file(in("sparse.png"), std::uintmax_t{8} << 30);
  expect_refused(track(in("sparse.png")), {"sparse.png", "larger than 256 MiB"});
  expect_refused("track /dev/zero --rig " + rig_ + " --out " + out("obs.csv"), {"/dev/zero", "no file"});
  expect_refused("estimate-rcm /dev/zero --out " + out("rcm.csv"), {"/dev/zero", "larger than 256 MiB"});
}

TEST_F(CommandLine, TheLeastFramesASecondThatServoTakesWork) {
  const std::string servo =
      "servo --rig " + lapservo::testing::source_folder().string() + "/configs/paper.yaml --robot sim";
  EXPECT_EQ(run(servo + " --fps 6 --duration 1"), 1) << errors();  // it has not converged, but it ran
  EXPECT_NE(output().find("not within 1 px"), std::string::npos) << output() << errors();
  expect_refused(servo + " --fps 5 --out " + out("run"), {"--fps", "expected a number of 6"});
}

TEST_F(CommandLine, ALogWithoutPeriodsIsNoSuccess) {
  const std::string paper = lapservo::testing::source_folder().string() + "/configs/paper.yaml";
  run("servo --rig " + paper + " --robot sim --duration 0.1 --out " + in("run"));
  const std::string log = read(in("run") + "/log.csv");
  std::ofstream(in("run") + "/log.csv") << log.substr(0, log.find('\n') + 1);
  expect_refused("servo --replay " + in("run") + "/log.csv", {"log.csv", "holds no tick"});
}

TEST_F(CommandLine, ServoRefusesWhatCanNotBe) {
  const std::string servo =
      "servo --rig " + lapservo::testing::source_folder().string() + "/configs/paper.yaml --out " + out("run");
  expect_refused(servo, {"--robot", "sim"});
  expect_refused(servo + " --robot psm9", {"--robot", "psm9", "sim"});
  expect_refused(servo + " --robot sim --set-point 0.9,795,365,900", {"--set-point", "can't be followed at 0.00 s"});
  expect_refused(servo + " --robot sim --set-point 0.9,795", {"--set-point"});
  expect_refused(servo + " --robot sim --via 1,2,3", {"--via", "four"});
  expect_refused(servo + " --robot sim --method fast", {"--method", "fast", "uncalibrated"});
  expect_refused(servo + " --robot sim --tracker magic", {"--tracker", "magic"});
  expect_refused(servo + " --robot sim --delay-ms soon", {"--delay-ms", "soon"});
  expect_refused(servo + " --robot sim --fps 1", {"--fps"});
  expect_refused(servo + " --robot sim --trajectory " + in("none.csv"), {"none.csv"});
  expect_refused(servo + " --robot sim --trajectory " +
                     in("fast.csv", "time_s,s_rad,r_px,l_px,d_px\n0,0.9,795,365,212\n0.1,0.9,855,365,212\n"),
                 {"fast.csv", "limits.rate"});
  expect_refused(servo + " --robot sim --controller " + in("gains.yaml", "gains_per_s: [1, 2, 3, -4]\n"),
                 {"gains", "-4"});
  expect_refused("servo --replay " + in("log.csv"), {"rig.yaml"});
  expect_refused("servo --rig " + lapservo::testing::source_folder().string() +
                     "/configs/paper.yaml --robot sim --out /proc/nowhere",
                 {"/proc/nowhere", "folder"});
}

// A registration that is off by 10 mm: without --strict it is said, with it the run ends.
TEST_F(CommandLine, ServoStrictRefusesAContradictedRegistration) {
  const std::string servo = "servo --rig " + lapservo::testing::source_folder().string() +
                            "/configs/paper.yaml --robot sim --start 0.05,1.57,0.064,1.2 --duration 1.5 ";
  const std::string off = "--registration-error 10,0,0 ";
  const auto contradicted = [&] { return output().find("registration_contradicted") != std::string::npos; };
  EXPECT_NE(run(servo), 2) << errors();
  EXPECT_FALSE(contradicted()) << output();
  EXPECT_EQ(run(servo + off), 1) << errors();
  EXPECT_TRUE(contradicted()) << output();
  EXPECT_EQ(run(servo + off + "--strict"), 1) << errors();
  EXPECT_TRUE(contradicted()) << output();
  EXPECT_NE(output().find("registration_contradicted in 1 of"), std::string::npos) << output();
}

TEST_F(CommandLine, ExperimentsWriteAReport) {
  ASSERT_EQ(run("experiment rcm --method surface --seed 3 --out " + out("report")), 0) << errors();
  EXPECT_TRUE(fs::exists(out("report") + "/report.html"));
  EXPECT_GT(CsvTable::read(out("report") + "/rcm.csv").rows(), 0U);
  fs::remove_all(out("report"));
  expect_refused("experiment cooking --out " + out("report"), {"cooking"});
  expect_refused("experiment rcm --out /proc/nowhere", {"/proc/nowhere"});
}

TEST_F(CommandLine, HelpShowsExamples) {
  for (const char* command :
       {"track", "view", "render", "marker", "marker design", "marker print", "marker show", "servo", "experiment",
        "estimate-rcm", "sim-robot", "record", "check", "calibrate", "calibrate all", "calibrate camera",
        "calibrate colour", "calibrate marker", "calibrate registration"}) {
    EXPECT_EQ(run(std::string(command) + " --help"), 0);
    EXPECT_NE(output().find("Example"), std::string::npos) << command;
  }
  EXPECT_EQ(run("--version"), 0);
  EXPECT_EQ(output().rfind("lapservo ", 0), 0U);
  EXPECT_EQ(run("fly"), 2);
}

// A swinging arm whose joints are read by another clock, from the other side of its gears: from a rig that knows
// their names only.
TEST_F(CommandLine, CalibrateRegistrationWritesWhereTheArmStands) {
  std::string plain = read(rig_);
  const std::string known = plain.substr(plain.find("    camera_from_rcm:"));
  plain.resize(plain.size() - known.size());
  const std::string joints_entry =
      "    joints: {names: [yaw, pitch, insertion, roll], sign: [1, 1, 1, 1], offset: [0, 0, 0, 0]}\n";
  const std::string unregistered = in("unregistered.yaml", plain + joints_entry);
  constexpr double fps = 8, clock_s = 0.4;
  constexpr int frames = 72;
  std::string poses = "theta_rad,phi_rad,rho_m,psi_rad\n", joints = "time_s,yaw,pitch,insertion,roll\n";
  const auto q_at = [](double t) {
    return std::array{-0.0778 + 0.25 * std::sin(0.9 * t), 1.75 + 0.14 * std::sin(1.3 * t + 1),
                      0.140 + 0.010 * std::sin(0.7 * t), 1.2 * std::sin(0.8 * t + 2)};
  };
  const auto row = [](const std::array<double, 4>& numbers) {
    std::string text;
    for (const double number : numbers) text += (text.empty() ? "" : ",") + std::to_string(number);
    return text + "\n";
  };
  for (int i = 0; i < frames; ++i) poses += row(q_at(i / fps));
  for (int i = -20; i < 50 * frames / fps + 20; ++i) {
    const auto q = q_at(i / 50.0);
    joints += std::to_string(i / 50.0 - clock_s) + "," + row({q[0], 1.5 - q[1], q[2] + 0.02, 0.7 - q[3]});
  }
  ASSERT_EQ(run("render --rig " + rig_ + " --out " + in("swing") + " --poses " + in("poses.csv", poses)), 0)
      << errors();
  const std::string calibrate =
      "calibrate registration " + in("swing") + " --fps 8 --rig " + unregistered + " --out " + out("rig.yaml");
  ASSERT_EQ(run(calibrate + " --joints " + in("joints.csv", joints) + " --report " + out("report.html")), 0)
      << errors();
  EXPECT_NE(read(out("report.html")).find("<svg"), std::string::npos);
  const std::string written = read(out("rig.yaml"));
  EXPECT_NE(written.find("sign: [1, -1, 1, -1]"), std::string::npos) << written;
  const auto numbers_of = [&](const std::string& key) {
    std::string text = written.substr(written.find("\n      " + key + ": [") + key.size() + 10);
    std::vector<double> numbers;
    for (std::size_t at = 0; at < text.find(']'); at = text.find(',', at) + 1)
      numbers.push_back(std::stod(text.substr(at)));
    return numbers;
  };
  const auto offset = numbers_of("offset"), translation = numbers_of("translation_m");
  EXPECT_NEAR(offset[1], 1.5, 1.7e-3);
  EXPECT_NEAR(offset[2], -0.02, 3e-4);
  EXPECT_NEAR(offset[3], 0.7, 3e-3);
  EXPECT_NEAR(translation[0], -0.077782, 3e-4);
  EXPECT_NEAR(translation[2], 0.059220, 3e-4);
  const std::string delay = "\n    image_delay_s: ";
  EXPECT_NEAR(std::stod(written.substr(written.find(delay) + delay.size())), clock_s, 5e-3);

  // The same swing judges both rigs: the first knows nothing yet.
  const std::string check = "check " + in("swing") + " --fps 8 --joints " + in("joints.csv") + " --rig ";
  EXPECT_EQ(run(check + out("rig.yaml") + " --out " + out("check.html")), 0) << errors() << output();
  EXPECT_NE(output().find("\ngood enough\n"), std::string::npos) << output();
  EXPECT_NE(read(out("check.html")).find("Rotation against encoder"), std::string::npos);
  EXPECT_EQ(run(check + unregistered), 1);
  EXPECT_NE(output().find("not good enough: the rig has no camera_from_rcm"), std::string::npos) << output();
  EXPECT_EQ(run(check + out("rig.yaml") + " --out " + out("rig.yaml")), 2);
  EXPECT_EQ(run("check " + in("nothing") + " --rig " + out("rig.yaml")), 2);

  // Without joints: from what was tracked without a registration; with one, the axes would pass through it anyway.
  ASSERT_EQ(run("track " + in("swing") + " --rig " + unregistered + " --out " + out("free.csv")), 0) << errors();
  ASSERT_EQ(run("calibrate registration " + out("free.csv") + " --rig " + unregistered + " --out " + out("rcm.yaml")),
            0)
      << errors();
  EXPECT_NE(output().find("is a convention"), std::string::npos);
  // A rig from a pipe, which can be read only once, gives the same.
  ASSERT_EQ(::mkfifo(in("pipe").c_str(), 0600), 0);
  ASSERT_EQ(std::system(("cat " + unregistered + " >" + in("pipe") + " &").c_str()), 0);
  ASSERT_EQ(run("calibrate registration " + out("free.csv") + " --rig " + in("pipe") + " --out " + out("piped.yaml")),
            0)
      << errors();
  EXPECT_EQ(read(out("piped.yaml")), read(out("rcm.yaml")));
  ASSERT_EQ(run("track " + in("swing") + " --rig " + out("rig.yaml") + " --out " + out("bound.csv")), 0) << errors();
  EXPECT_EQ(
      run("calibrate registration " + out("bound.csv") + " --rig " + out("rig.yaml") + " --out " + out("no.yaml")), 1);
  EXPECT_NE(errors().find("camera_from_rcm"), std::string::npos);
  EXPECT_FALSE(fs::exists(out("no.yaml")));

  EXPECT_EQ(run(calibrate + " --joints " + in("other.csv", "time_s,a,b,c,d\n0,1,2,3,4\n1,1,2,3,4\n")), 2);
  EXPECT_NE(errors().find("yaw"), std::string::npos);
#ifdef LAPSERVO_TEST_BAGS
  write_bags_of("swing", fps, CsvTable::read(in("joints.csv")));
  expect_tracked_as(out("bound.csv"), in("run.bag"), out("rig.yaml"));
  expect_tracked_as(out("bound.csv"), in("run"), out("rig.yaml"));
  for (const char* bag : {"run.bag", "run"}) {
    ASSERT_EQ(run("calibrate registration " + in(bag) + " --rig " + unregistered + " --out " + out("bag.yaml")), 0)
        << errors();
    expect_same_numbers(written, read(out("bag.yaml")));
  }
  // The loop over the same recording; what it decided is a run's log like any other.
  const std::string decide = "servo --replay " + in("run.bag") + " --rig ";
  ASSERT_EQ(run(decide + out("rig.yaml") + " --out " + out("decided")), 0) << errors() << output();
  EXPECT_NE(output().find("72 images and the joints; nothing was sent"), std::string::npos) << output();
  EXPECT_EQ(output().find("not_following"), std::string::npos) << output();
  EXPECT_EQ(run("servo --replay " + out("decided/log.csv")), 0) << errors();
  EXPECT_EQ(run(decide + out("rig.yaml") + " --out " + out("decided")), 2);
  EXPECT_EQ(run(decide + out("rig.yaml") + " --enable-motion"), 2);
  EXPECT_EQ(run(decide + rig_), 2);
  EXPECT_NE(errors().find("joints is missing"), std::string::npos) << errors();
  EXPECT_EQ(run(decide + out("rig.yaml") + " --joint-topic /PSM2/measured_js"), 2);
  EXPECT_NE(errors().find("/PSM1/measured_js"), std::string::npos) << errors();
#endif
}

// A turn of a print that is not the rig's: the marker is wrapped askew, and joints say where its seam lies.
TEST_F(CommandLine, CalibrateMarkerWritesTheRigOfThePrint) {
  constexpr int frames = 48;
  const std::string plain = read(rig_);
  const auto with = [&](const std::string& bands, const std::string& more) {
    std::string text = plain;
    const auto replace = [&](const std::string& from, const std::string& to) {
      const auto at = text.find(from);
      ASSERT_NE(at, std::string::npos) << from;
      text.replace(at, from.size(), to);
    };
    if (!bands.empty()) replace("bands_upper_m: [0.0035, 0.0035, 0.017]", "bands_upper_m: " + bands);
    replace("seam_rad: 0.0", "seam_rad: 0.0" + more);
    return text +
           "    joints: {names: [yaw, pitch, insertion, roll], sign: [1, 1, 1, 1], offset: [0, 0, 0, 0]}\n"
           "    image_delay_s: 0.1\n    sigma_image_delay_s: 0.01\n";
  };
  const std::string real = in("real.yaml", with("[0.0037, 0.0032, 0.0171]", "\n      wrap_m: 0.0013"));
  const std::string designed = in("designed.yaml", with("", ""));
  std::string poses = "theta_rad,phi_rad,rho_m,psi_rad\n", joints = "time_s,roll,yaw,pitch,insertion\n";
  for (int i = 0; i < frames; ++i) {
    const double psi_rad = -3 + 6.6 * i / frames;
    const auto number = [](double value) { return std::to_string(value); };
    poses += number(-0.0778 + 0.01 * std::sin(0.3 * i)) + ",1.7681,0.1405," + number(psi_rad) + "\n";
    // The arm's psi starts elsewhere: the seam lies 0.3 rad farther than the rig says. Its clock is late by 0.1 s.
    joints += number(i / 30.0 - 0.1) + "," + number(psi_rad - 0.3) + ",0,0,0\n";
  }
  ASSERT_EQ(run("render --rig " + real + " --out " + in("turn") + " --poses " + in("poses.csv", poses)), 0) << errors();
  fs::remove(in("turn") + "/rig.yaml");

  const std::string calibrate = "calibrate marker " + in("turn") + " --rig " + designed + " --out " + out("rig.yaml");
  ASSERT_EQ(run(calibrate + " --joints " + in("joints.csv", joints) + " --report " + out("report.html")), 0)
      << errors();
  EXPECT_NE(output().find("seam_rad"), std::string::npos);
  EXPECT_NE(read(out("report.html")).find("<svg"), std::string::npos);
  const std::string written = read(out("rig.yaml"));
  for (const char* key : {"sigma_bands_upper_m", "sigma_wrap_m", "sigma_seam_rad", "sigma_image_delay_s: 0.01"})
    EXPECT_NE(written.find(key), std::string::npos) << key;
  const auto value_of = [&](const std::string& key) {
    return std::stod(written.substr(written.find("\n      " + key + ": ") + key.size() + 9));
  };
  EXPECT_NEAR(value_of("wrap_m"), 0.0013, 2e-5);
  EXPECT_NEAR(value_of("seam_rad"), 0.3, 5e-3);
  ASSERT_EQ(run("track " + in("turn") + " --rig " + out("rig.yaml") + " --out " + out("obs.csv")), 0) << errors();
  const CsvTable observed = CsvTable::read(out("obs.csv"));
  for (std::size_t row = 0; row < observed.rows(); ++row) EXPECT_EQ(observed.text(row, "status"), "ok") << row;

  // What can't tell leaves what was there.
  const std::string before = written;
  fs::create_directories(in("few"));
  for (const char* name : {"0000.png", "0010.png", "0020.png"})
    fs::copy_file(in("turn") + "/" + name, in("few") + "/" + name);
  EXPECT_EQ(run("calibrate marker " + in("few") + " --rig " + designed + " --out " + out("rig.yaml")), 1);
  EXPECT_NE(errors().find("film a slow full turn"), std::string::npos) << errors();
  EXPECT_EQ(read(out("rig.yaml")), before);
}

TEST_F(CommandLine, CalibratesACamera) {
  Camera camera;
  camera.width_px = 640, camera.height_px = 480;
  camera.fx_px = camera.fy_px = 612.5, camera.cx_px = 326.2, camera.cy_px = 233.1;
  camera.response = {Response::Kind::rec709};
  fs::create_directories(in("boards"));
  int number = 0;
  for (const Rigid3& pose : boards::different_poses({}, camera, 5, 3))
    cv::imwrite(in("boards/" + std::to_string(number++) + ".png"), boards::render({}, camera, pose, 7));
  cv::imwrite(in("boards/9.png"), cv::Mat(480, 640, CV_8UC3, cv::Scalar(90, 90, 90)));
  const std::string rig = in("rig.yaml", R"(camera:
  image_width: 640
  image_height: 480
  camera_matrix: {rows: 3, cols: 3, data: [600, 0, 320, 0, 600, 240, 0, 0, 1]}
instruments:
  - name: PSM1
    marker:
      diameter_m: 0.0084
      bands_upper_m: [0.0035, 0.0035, 0.017]
      bands_lower_m: [0.0095, 0.0095, 0.005]
)");
  const std::string board = " --board 9x6 --square-mm 5", before = read(rig);
  // Too few, and none: the rig is as it was.
  EXPECT_EQ(run("calibrate camera " + in("boards/0.png") + board + " --rig " + rig), 1);
  EXPECT_NE(errors().find("3 more views"), std::string::npos) << errors();
  EXPECT_EQ(run("calibrate camera " + in("boards/9.png") + board + " --rig " + rig), 1);
  EXPECT_NE(errors().find("in none of 1 pictures"), std::string::npos) << errors();
  EXPECT_EQ(read(rig), before);

  ASSERT_EQ(run("calibrate camera " + in("boards") + board + " --rig " + rig + " --camera-info " + out("camera.yaml") +
                " --report " + out("report.html")),
            0)
      << errors();
  EXPECT_NE(output().find("response: rec709"), std::string::npos) << output();
  EXPECT_NE(output().find("there is no board: " + in("boards/9.png")), std::string::npos) << output();
  EXPECT_NE(read(out("report.html")).find("<svg"), std::string::npos);
  for (const std::string& text : {read(rig), read(out("camera.yaml"))})
    for (const char* key : {"sigma_camera_matrix", "sigma_distortion_coefficients", "response: rec709",
                            "sigma_lateral_chromatic_aberration"})
      EXPECT_NE(text.find(key), std::string::npos) << key;
  // Both can be read: a rig may name the camera's file.
  std::string other = before;
  other.replace(0, other.find("instruments"), "camera: " + out("camera.yaml") + "\n");
  const std::string empty = in("boards/9.png");
  for (const std::string& calibrated : {rig, in("other.yaml", other)})
    EXPECT_EQ(run("track " + empty + " --rig " + calibrated + " --out " + out("obs.csv")), 1) << errors();
}

// It must not even be read: nobody writes into this one.
TEST_F(CommandLine, CalibrateAllRefusesARigThatCanNotBeReplaced) {
  const std::string pipe = in("pipe");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  expect_refused("calibrate all --no-questions --rig " + pipe,
                 {"pipe: is a pipe or a device", "each step replaces it"});
}

TEST_F(CommandLine, CalibrateCameraRefusesBadInput) {
  cv::imwrite(in("large.png"), cv::Mat(90, 160, CV_8UC3, cv::Scalar(20, 20, 20)));
  cv::imwrite(in("small.png"), cv::Mat(80, 160, CV_8UC3, cv::Scalar(20, 20, 20)));
  const std::string to = " --out " + out("camera.yaml"), board = " --board 9x6 --square-mm 5";
  const std::string calibrate = "calibrate camera " + in("large.png");
  expect_refused(calibrate + " --square-mm 5 --board 9by6" + to, {"--board", "9by6", "inner corners"});
  expect_refused(calibrate + " --square-mm 0 --board 9x6" + to, {"--square-mm"});
  expect_refused(calibrate + board, {"--rig, --out or --camera-info"});
  expect_refused(calibrate + " " + in("small.png") + board + to, {"small.png", "160 x 80", "160 x 90", "large.png"});
  expect_refused(calibrate + board + " --rig " + rig_, {"large.png", "160 x 90", "the rig's camera"});
  expect_refused(calibrate + board + to + " --aruco DICT_9", {"--aruco", "DICT_9", "DICT_4X4_50"});
  expect_refused(calibrate + board + to + " --marker-mm 3", {"--marker-mm", "--aruco"});
  expect_refused(calibrate + board + to + " --report " + out("camera.yaml"), {"camera.yaml", "two results"});
  expect_refused(calibrate + board + " --out " + in("large.png"), {"large.png", "input itself"});
}

TEST_F(CommandLine, CalibrateMarkerRefusesBadInput) {
  cv::imwrite(in("small.png"), cv::Mat(90, 160, CV_8UC3, cv::Scalar(20, 20, 20)));
  const std::string rig = " --rig " + rig_ + " --out " + out("rig.yaml");
  expect_refused("calibrate marker " + in("small.png") + rig, {"small.png", "160 x 90", "1280 x 720"});
  expect_refused("calibrate marker " + in("none.png") + rig, {"none.png"});
  expect_refused("calibrate marker " + in("small.png") + rig + " --instrument B", {"--instrument", "B"});
  expect_refused("calibrate marker " + in("small.png") + rig + " --joints " + in("joints.csv", "time_s\n1\n"),
                 {"joints", "PSM1", "lacks"});
  expect_refused("calibrate marker " + in("small.png") + " --rig " + rig_ + " --out " + in("small.png"), {"small.png"});
  expect_refused("calibrate marker " + in("small.png") + rig + " --report " + out("rig.yaml"), {"--out and --report"});
}

}  // namespace
}  // namespace lapservo
