// From nothing to a checked rig, on recordings of an arm, an endoscope and a print that nobody knows beforehand, by
// every command of docs/tutorial.md. LAPSERVO_TUTORIAL_FOLDER keeps the folder, for docs/tutorial/pictures.sh.

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <sys/wait.h>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "lapservo/core/angles.h"
#include "lapservo/rig/joint_conversion.h"
#include "lapservo/rig/rig_writer.h"
#include "lapservo/testing/boards.h"
#include "lapservo/testing/sample_frames.h"
#include "lapservo/testing/scenes.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo {
using namespace internal;
namespace {
namespace fs = std::filesystem;
using lapservo::testing::read_file;
using lapservo::testing::write_file;

constexpr double fps = 8, delay_s = 0.12;
constexpr int turn_frames = 48, swing_frames = 100;

// As everything really is.
Rig true_rig() {
  Rig rig = scenes::usual_rig();
  Instrument& instrument = rig.instruments[0];
  instrument.marker.hues_deg = {116, 209, 294};
  instrument.marker.bands_upper_m = {0.00364, 0.00341, 0.01695},
  instrument.marker.bands_lower_m = {0.0094, 0.0096, 0.005};
  instrument.marker.seam_rad = 0;
  instrument.joints = Joints{{"yaw", "pitch", "insertion", "roll"}, {1, -1, 1, 1}, {0, 1.5, -0.012, 0.4}};
  instrument.image_delay_s = delay_s;
  return rig;
}

// The values of the data sheets.
std::string designed_rig() {
  return R"(camera:
  image_width: 960
  image_height: 540
  camera_matrix: {rows: 3, cols: 3, data: [800, 0, 479.5, 0, 800, 269.5, 0, 0, 1]}
instruments:
  - name: PSM1
    marker:
      diameter_m: 0.0084
      bands_upper_m: [0.0035, 0.0035, 0.017]
      bands_lower_m: [0.0095, 0.0095, 0.005]
    joints:
      names: [yaw, pitch, insertion, roll]
      sign: [1, 1, 1, 1]
      offset: [0, 0, 0, 0]
)";
}

JointVector turning(double t) {
  const double whole_s = turn_frames / fps;
  return {0.02 * std::sin(t), 1.57, 0.089, -3 + 1.05 * two_pi * t / whole_s};
}
JointVector swinging(double t) {
  return {0.22 * std::sin(0.9 * t), 1.57 + 0.18 * std::sin(1.3 * t + 1), 0.089 + 0.008 * std::sin(0.7 * t),
          3.3 * std::sin(0.6 * t + 2)};
}

class Tutorial : public ::testing::Test {
 protected:
  // Rendered once.
  static void SetUpTestSuite() {
    const char* kept = std::getenv("LAPSERVO_TUTORIAL_FOLDER");
    if (kept)
      recordings_ = kept;
    else
      temporary_ = new lapservo::testing::TemporaryFolder, recordings_ = temporary_->path();
    const Rig rig = true_rig();
    write_file(recordings_ / "truth.yaml", rig_yaml(rig));
    fs::create_directories(recordings_ / "boards");
    int number = 0;
    for (const Rigid3& pose : boards::different_poses({}, rig.camera, 6, 3))
      cv::imwrite((recordings_ / "boards" / fmt::format("{}.png", number++)).string(),
                  boards::render({}, rig.camera, pose, 7));
    record("turn", turn_frames, turning);
    record("swing", swing_frames, swinging);
  }
  static void TearDownTestSuite() { delete temporary_; }

  static void record(const std::string& name, int frames, JointVector (*q_at)(double)) {
    std::string poses = "theta_rad,phi_rad,rho_m,psi_rad\n", joints = "time_s,yaw,pitch,insertion,roll\n";
    const auto row = [](const Eigen::Vector4d& v) { return fmt::format("{},{},{},{}\n", v[0], v[1], v[2], v[3]); };
    for (int i = 0; i < frames; ++i) poses += row(q_at(i / fps).vector());
    for (double t = -0.5; t < frames / fps + 0.5; t += 0.02)
      joints +=
          fmt::format("{},", t - delay_s) + row(joints_from_q(*true_rig().instruments[0].joints, q_at(t).vector()));
    write_file(recordings_ / (name + "_poses.csv"), poses), write_file(recordings_ / (name + "_joints.csv"), joints);
    ASSERT_EQ(run_in(recordings_,
                     "lapservo render --rig truth.yaml --out " + name + " --poses " + name + "_poses.csv --force"),
              0);
    fs::remove(recordings_ / name / "rig.yaml"), fs::remove(recordings_ / name / "truth.csv");
  }

  // A line as a user types it, in a folder.
  static int run_in(const fs::path& folder, const std::string& command) {
    const fs::path tool(LAPSERVO_TOOL);
    const std::string whole =
        fmt::format("cd '{}' && PATH='{}':\"$PATH\" && {{ {}\n}} >'{}' 2>&1 </dev/null", folder.string(),
                    tool.parent_path().string(), command, (recordings_ / "said.txt").string());
    const int status = std::system(("bash -c " + quoted(whole)).c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  static std::string quoted(const std::string& text) {
    std::string all = "'";
    for (const char c : text) all += c == '\'' ? "'\\''" : std::string(1, c);
    return all + "'";
  }
  static std::string said() { return read_file(recordings_ / "said.txt"); }

  // Every number of the rig is what it really is.
  static void expect_true(const Rig& found) {
    const Rig truth = true_rig();
    EXPECT_NEAR(found.camera.fx_px, truth.camera.fx_px, 1);
    const Instrument &is = found.instruments[0], &was = truth.instruments[0];
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(is.marker.hues_deg[i], was.marker.hues_deg[i], 4);
      EXPECT_NEAR(is.marker.bands_upper_m[i], was.marker.bands_upper_m[i], 5e-5);
    }
    ASSERT_TRUE(is.camera_from_rcm);
    EXPECT_LT((is.camera_from_rcm->translation - was.camera_from_rcm->translation).norm(), 0.6e-3);
    EXPECT_EQ(is.joints->sign, was.joints->sign);
    EXPECT_NEAR(is.image_delay_s.value(), delay_s, 5e-3);
  }

  static inline lapservo::testing::TemporaryFolder* temporary_ = nullptr;
  static inline fs::path recordings_;
};

// The lines of all blocks that are shell commands, in their order.
std::vector<std::string> commands_of(const std::string& markdown) {
  std::vector<std::string> commands;
  std::istringstream text(markdown);
  bool shell = false;
  for (std::string line; std::getline(text, line);) {
    if (line.rfind("```", 0) == 0)
      shell = line == "```sh";
    else if (shell && !commands.empty() && commands.back().ends_with("\\"))
      commands.back() += "\n" + line;
    else if (shell && !line.empty())
      commands.push_back(line);
  }
  return commands;
}

// calibrate all, stopped between its steps by what is missing.
TEST_F(Tutorial, EveryCommandWorksAndCalibrateAllGoesOnWhereItStopped) {
  const std::string markdown = read_file(lapservo::testing::source_folder() / "docs/tutorial.md");
  const auto commands = commands_of(markdown);
  ASSERT_GE(commands.size(), 8U);
  write_file(recordings_ / "rig.yaml", designed_rig());
  EXPECT_NE(markdown.find(designed_rig()), std::string::npos) << "what the page begins with";
  const fs::path record = recordings_ / "rig.calibration.yaml";
  for (const std::string& command : commands) {
    SCOPED_TRACE(command);
    const bool all = command.rfind("lapservo calibrate all", 0) == 0;
    if (all) {
      fs::rename(recordings_ / "swing_joints.csv", recordings_ / "elsewhere.csv");
      ASSERT_EQ(run_in(recordings_, command), 2) << said();
      const std::string done = read_file(record);
      EXPECT_NE(done.find("name: marker"), std::string::npos) << done;
      EXPECT_EQ(done.find("name: registration"), std::string::npos) << done;
      fs::rename(recordings_ / "elsewhere.csv", recordings_ / "swing_joints.csv");
    }
    ASSERT_EQ(run_in(recordings_, command), 0) << said();
    if (!all) continue;
    for (const char* name : {"camera", "colour", "marker"})
      EXPECT_NE(said().find(std::string(name) + ": done on 2"), std::string::npos) << said();
    EXPECT_NE(said().find("\nregistration: lapservo calibrate registration swing --rig rig.yaml"), std::string::npos);
    EXPECT_NE(said().find("\ngood enough\n"), std::string::npos) << said();
    // All of it is there: nothing is measured again.
    const std::string before = read_file(recordings_ / "rig.yaml");
    ASSERT_EQ(run_in(recordings_, command), 0) << said();
    for (const char* name : {"camera", "colour", "marker", "registration", "check"})
      EXPECT_NE(said().find(std::string(name) + ": done on 2"), std::string::npos) << said();
    EXPECT_EQ(read_file(recordings_ / "rig.yaml"), before);
  }
  expect_true(load_rig(recordings_ / "rig.yaml"));
}

TEST_F(Tutorial, HasItsPictures) {
  const fs::path folder = lapservo::testing::source_folder() / "docs/tutorial";
  for (const char* picture : {"marker.png", "overlay.jpg", "check.png"}) {
    ASSERT_TRUE(fs::exists(folder / picture)) << picture;
    EXPECT_LT(fs::file_size(folder / picture), 400000U) << picture;
  }
}

// Without a recording there is nothing to do, and a rig that somebody edits is another.
TEST_F(Tutorial, CalibrateAllSaysWhatItDidNot) {
  write_file(recordings_ / "mine.yaml", designed_rig());
  const std::string start = "lapservo calibrate all --rig mine.yaml --no-questions";
  ASSERT_EQ(run_in(recordings_, start), 0) << said();
  EXPECT_NE(said().find("camera: left out; --boards names"), std::string::npos) << said();
  EXPECT_FALSE(fs::exists(recordings_ / "mine.calibration.yaml"));
  write_file(recordings_ / "mine.calibration.yaml",
             "rig: another\nsteps:\n  - {name: camera, command: a, inputs: b, when: 2026}\n");
  ASSERT_EQ(run_in(recordings_, start), 0) << said();
  EXPECT_NE(said().find("mine.yaml is not as the last step left it"), std::string::npos) << said();
  EXPECT_EQ(run_in(recordings_, start + " --boards boards"), 2);
  EXPECT_NE(said().find("needs --board and --square-mm"), std::string::npos) << said();
  EXPECT_EQ(run_in(recordings_, start + " --redo marker"), 2);
  EXPECT_NE(said().find("--redo: marker needs --turn"), std::string::npos) << said();
  EXPECT_EQ(run_in(recordings_, start + " --turn /dev/video0"), 2);
  EXPECT_NE(said().find("expected a folder with files"), std::string::npos) << said();
}

}  // namespace
}  // namespace lapservo
