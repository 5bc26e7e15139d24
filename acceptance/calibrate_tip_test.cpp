// The tip of tools by rendered images with noise: an instrument that turns in a dimple, touches a board, or is measured
// by callipers. The truth is the kinematics that place the rendered marker.
// LAPSERVO_TIP_RECORDINGS and LAPSERVO_TIP_SEED set the number of laboratories (1) and the first one. Prints a table.

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "acceptance/laboratory.h"
#include "acceptance/tool_test.h"
#include "lapservo/calibration/tip/tip_fit.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/statistics.h"
#include "lapservo/io/image_file.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/rig_writer.h"
#include "lapservo/testing/environment.h"
#include "lapservo/tool/test_tools.h"

namespace lapservo::acceptance::calibrate_tip_test {
using namespace internal;
using namespace laboratories;

const Eigen::Vector3d point_m(0.02, -0.02, 0.125);  // camera frame: the dimple, the middle of the board
const Eigen::Vector3d usual_axis(0.65, -0.5, 0.57);

std::vector<std::uint64_t> seeds() {
  return testing::seeds_from_environment("LAPSERVO_TIP_RECORDINGS", "LAPSERVO_TIP_SEED");
}

// Straight, or a wrist with joints like dVRK's needle drivers, somewhere behind the marker.
Tool true_tool(std::uint64_t seed, const Marker& marker, bool with_wrist) {
  Random random(31 * seed);
  Tool tool;
  if (with_wrist) {
    tool = needle_driver();
    for (WristJoint& joint : tool.wrist) joint.offset_rad = joint.sigma_reading_rad * random.normal();
  }
  Tool::Place& place = tool.place.emplace();
  const auto off_axis_m = [&] { return off_axis_sigma_m * random.normal(); };
  const double beyond_m = with_wrist ? random.uniform(0.012, 0.02) : random.uniform(0.025, 0.045);
  place.base_in_marker_m = {off_axis_m(), off_axis_m(), marker.length_m() + beyond_m};
  if (with_wrist) place.azimuth_rad = random.uniform(-pi, pi);
  return tool;
}

Tool unplaced(Tool tool) {
  tool.place.reset();
  for (WristJoint& joint : tool.wrist) joint.offset_rad = 0;
  return tool;
}

struct Orientation {
  double right_rad = 0, down_rad = 0, roll_rad = 0;
};

// A laboratory's instrument before a background.
class Scene {
 public:
  Scene(std::uint64_t seed, const cv::Mat& background)
      : seed_(seed),
        marker_(laboratory(seed).instruments[0].marker),
        renderer_(laboratory(seed).camera, shafts_of(laboratory(seed)), background, with_noise(1)) {}

  cv::Mat image(const Orientation& at, const Eigen::Vector3d& tip_in_marker_m, const Eigen::Vector3d& tip_in_camera_m) {
    const Eigen::Quaterniond turn = rotation_by({at.down_rad, at.right_rad, 0}) *
                                    rotation_between(Eigen::Vector3d::UnitZ(), usual_axis) *
                                    rotation_by({0, 0, at.roll_rad});
    const Rigid3 marker_in_camera{turn, tip_in_camera_m - turn * tip_in_marker_m};
    const Rigid3 marker_from_unrolled = camera_from_marker(marker_, {}, 0).inverse();
    return renderer_.render({{marker_in_camera * marker_from_unrolled, 0}}, 1000 * seed_ + count_++);
  }

 private:
  std::uint64_t seed_, count_ = 0;
  Marker marker_;
  Renderer renderer_;
};

// The rig that is calibrated.
Rig rig_without_tool(std::uint64_t seed) {
  Rig rig = laboratory(seed);
  rig.instruments[0].camera_from_rcm.reset(), rig.instruments[0].joints.reset(),
      rig.instruments[0].image_delay_s.reset();
  return rig;
}

class Eye {
 public:
  explicit Eye(std::uint64_t seed) : tracker_(rig_without_tool(seed), {.frame_budget = std::nullopt}) {}

  std::optional<TimedPose> look(const cv::Mat& image, double time_s) {
    const Observation& seen = tracker_.track(image)[0];
    if (seen.status != Status::ok || !seen.marker) return std::nullopt;
    return TimedPose{time_s, *seen.marker};
  }

 private:
  Tracker tracker_;
};

constexpr double pivot_fps = 6;

void show_pivot(std::uint64_t seed, const Tool& truth, bool compressed,
                const std::function<void(const cv::Mat&, double)>& look) {
  constexpr double seconds = 20;
  const double fps = compressed ? 30 : pivot_fps;
  const Camera camera = laboratory(seed).camera;
  Scene scene(seed, make_tissue(camera.width_px, camera.height_px, seed));
  Random random(seed);
  const std::array<double, 3> phases{random.uniform(0, two_pi), random.uniform(0, two_pi), random.uniform(0, two_pi)};
  const Eigen::Vector3d tip_m =
      tip_in_marker(truth, std::vector<double>(truth.wrist.size(), 0)).marker_from_tip.translation;
  const auto image = [&](int i) {
    const double t = i / fps;
    const Orientation at{0.3 * std::sin(0.9 * t + phases[0]), 0.3 * std::sin(1.3 * t + phases[1]),
                         1.2 * std::sin(0.5 * t + phases[2])};
    return scene.image(at, tip_m, point_m);
  };
  show(static_cast<int>(seconds * fps), fps, compressed, image, look);
}

TipCalibration pivot(std::uint64_t seed, const Tool& truth, bool compressed) {
  Eye eye(seed);
  std::vector<TimedPose> poses;
  show_pivot(seed, truth, compressed, [&](const cv::Mat& bgr, double time_s) {
    if (const auto pose = eye.look(bgr, time_s)) poses.push_back(*pose);
  });
  return pivoted_tip(unplaced(truth), std::vector<double>(truth.wrist.size(), 0), poses);
}

struct ShownTouch {
  cv::Mat image;
  int column, row;
  Eigen::Vector3d corner_in_camera_m;
  std::vector<double> wrist_rad{};
};

// By a hand that sets the tip on corners of a board to 0.1 mm. The image of the board alone is returned.
cv::Mat show_touches(std::uint64_t seed, const Tool& truth, int count,
                     const std::function<void(const ShownTouch&)>& look) {
  const Camera camera = laboratory(seed).camera;
  const BoardScene scene;
  Random random(seed);
  const Eigen::Vector3d middle_m(4 * scene.square_m, 2.5 * scene.square_m, 0);
  const Eigen::Quaterniond lying = rotation_by({random.uniform(-0.5, 0.5), random.uniform(-0.3, 0.3), 0});
  const Rigid3 camera_from_board{lying, point_m - lying * middle_m};
  const cv::Mat board = render_board(scene, camera, camera_from_board, seed);
  const LightTable light_of = camera.response.table();
  cv::Mat background(board.size(), CV_32FC3);
  for (int v = 0; v < board.rows; ++v)
    for (int u = 0; u < board.cols; ++u)
      for (int c = 0; c < 3; ++c) background.at<cv::Vec3f>(v, u)[c] = light_of[board.at<cv::Vec3b>(v, u)[c]];
  Scene instrument(seed, background);
  for (int i = 0; i < count; ++i) {
    ShownTouch touch{{}, 1 + i % 4 * 2, i / 4 * 2, {}};
    for (std::size_t k = 0; k < truth.wrist.size(); ++k) touch.wrist_rad.push_back(random.uniform(-0.8, 0.8));
    touch.corner_in_camera_m =
        camera_from_board * Eigen::Vector3d(scene.square_m * touch.column, scene.square_m * touch.row, 0);
    const Eigen::Vector3d by_hand_m =
        lying * Eigen::Vector3d(0.07e-3 * random.normal(), 0.07e-3 * random.normal(), 0.03e-3 * random.normal());
    const Orientation at{random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3), random.uniform(-1.2, 1.2)};
    touch.image = instrument.image(at, tip_in_marker(truth, touch.wrist_rad).marker_from_tip.translation,
                                   touch.corner_in_camera_m + by_hand_m);
    look(touch);
  }
  return board;
}

TipCalibration touch(std::uint64_t seed, const Tool& truth, int count) {
  Eye eye(seed);
  std::vector<TipSighting> touches;
  std::vector<std::string> names;
  show_touches(seed, truth, count, [&](const ShownTouch& shown) {
    const auto pose = eye.look(shown.image, static_cast<double>(touches.size()));
    if (!pose) return;
    touches.push_back({*pose, shown.wrist_rad, shown.corner_in_camera_m});
    names.push_back("touch " + std::to_string(touches.size()));
  });
  return touched_tip(unplaced(truth), touches, names);
}

// Errors of a way, one of the tip's axes each.
struct Row {
  std::string name;
  std::vector<double> errors_mm{}, in_sigmas{};
  int refused = 0;

  void add(const TipCalibration& found, const Tool& truth, double wrist_rad = 0) {
    if (!found.refusal.empty()) {
      ++refused, std::printf("%s refused: %s\n", name.c_str(), found.refusal.c_str());
      return;
    }
    if (!found.fault.empty()) std::printf("%s: %s\n", name.c_str(), found.fault.c_str());
    const std::vector<double> at_rad(truth.wrist.size(), wrist_rad);
    const TipInMarker tip = tip_in_marker(found.tool, at_rad);
    const Eigen::Vector3d error_m =
        tip.marker_from_tip.translation - tip_in_marker(truth, at_rad).marker_from_tip.translation;
    const Eigen::Vector3d whitened = whitening_of(tip.of_place.topLeftCorner<3, 3>()) * error_m;
    for (Eigen::Index i = 0; i < 3; ++i) errors_mm.push_back(1e3 * error_m[i]), in_sigmas.push_back(whitened[i]);
  }

  // `most_mm`: of the distance in space.
  void expect(double most_mm) const {
    const double distance_mm = std::sqrt(3.0) * rms(errors_mm);
    std::printf("%-28s %zu tips, %d refused: rms %.3f mm in space, error / sigma %.2f\n", name.c_str(),
                errors_mm.size() / 3, refused, distance_mm, rms(in_sigmas));
    EXPECT_EQ(refused, 0) << name;
    EXPECT_LT(distance_mm, most_mm) << name;
    EXPECT_LT(rms(in_sigmas), 2) << name;
    if (seeds().size() < 20) return;
    EXPECT_GT(rms(in_sigmas), 0.7) << name;
    EXPECT_LT(rms(in_sigmas), 1.4) << name;
  }
};

TEST(CalibrateTip, ByAPivot) {
  Row straight{"pivot, straight tool"}, wristed{"pivot, straight wrist"}, video{"pivot, straight tool, H.264"};
  for (const std::uint64_t seed : seeds())
    for (Row* row : {&straight, &wristed, &video}) {
      const Tool truth = true_tool(seed, laboratory(seed).instruments[0].marker, row == &wristed);
      row->add(pivot(seed, truth, row == &video), truth);
    }
  straight.expect(0.1), wristed.expect(0.1);
  video.expect(0.4);  // compression moves the boundaries of neighbouring frames alike: its sigmas are as large
}

TEST(CalibrateTip, ByTouch) {
  Row straight{"touch, straight tool"}, wristed{"touch, bent wrist, at 0"}, bent{"touch, bent wrist, at 0.5"};
  for (const std::uint64_t seed : seeds()) {
    const Marker& marker = laboratory(seed).instruments[0].marker;
    const Tool simple = true_tool(seed, marker, false), truth = true_tool(seed, marker, true);
    straight.add(touch(seed, simple, 6), simple);
    const TipCalibration found = touch(seed, truth, 12);
    wristed.add(found, truth), bent.add(found, truth, 0.5);
  }
  straight.expect(0.15), wristed.expect(0.15), bent.expect(0.15);
}

TEST(CalibrateTip, ByCallipers) {
  Row straight{"callipers, straight tool"}, wrist{"callipers, wrist's axis"}, tip{"callipers, tip beyond it"};
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
    for (Row* row : {&straight, &wrist, &tip}) {
      const Rig rig = laboratory(seed);
      const Marker& marker = rig.instruments[0].marker;
      Tool truth = true_tool(seed, marker, row != &straight);
      const double read_m = truth.place->base_in_marker_m.z() - marker.length_m() + 1e-4 * Random(seed).normal();
      TipCalibration found;
      found.tool = placed_by_calliper(unplaced(truth), marker, read_m, 1e-4);
      if (row == &wrist)
        for (Tool* tool : {&truth, &found.tool}) tool->wrist.clear(), tool->last_from_tip = {};
      row->add(found, truth);
    }
  straight.expect(0.2), wrist.expect(0.2);
  tip.expect(0.6);  // its joints are off by a degree, 19 mm away
}

// The rig that the tool wrote has the tip.
void expect_tip(const std::string& rig_file, const Tool& truth, double most_m) {
  const Tool found = load_rig(rig_file).instruments[0].tool.value();
  const std::vector<double> straight_rad(truth.wrist.size(), 0);
  const TipInMarker tip = tip_in_marker(found, straight_rad), expected = tip_in_marker(truth, straight_rad);
  EXPECT_LT((tip.marker_from_tip.translation - expected.marker_from_tip.translation).norm(), most_m);
  EXPECT_GT((tip.of_place.topLeftCorner<3, 3>().trace()), 0);
}

class CalibrateTipTool : public ToolTest {};

TEST_F(CalibrateTipTool, FindsTheTipByAPivotOrSaysWhyNot) {
  constexpr std::uint64_t seed = 5;
  const Rig rig = rig_without_tool(seed);
  const Tool truth = true_tool(seed, rig.instruments[0].marker, false);
  testing::write_file("rig.yaml", rig_yaml(rig));
  std::filesystem::create_directory("pivot");
  int count = 0;
  show_pivot(seed, truth, false,
             [&](const cv::Mat& bgr, double) { write_image("pivot/" + std::to_string(count++) + ".png", bgr); });
  std::filesystem::create_directory("short");
  std::filesystem::copy("pivot/0.png", "short/0.png");
  const std::string to = " --fps 6 --rig rig.yaml --out tip.yaml";
  expect_done("calibrate tip --pivot pivot" + to);
  expect_failed("calibrate tip --pivot short" + to, {"the rig is as it was"});
  expect_tip("tip.yaml", truth, 0.1e-3);
  ToolTest::expect_refused("calibrate tip" + to, {"--pivot, --touch or --calliper"});
  ToolTest::expect_refused("calibrate tip --calliper 20,5 --rig rig.yaml --out tip.yaml", {"20,5", "MM:SIGMA"});
  expect_done("calibrate tip --calliper 20.5:0.05 --rig rig.yaml --out calliper.yaml");
  const Tool::Place place = load_rig("calliper.yaml").instruments[0].tool.value().place.value();
  EXPECT_NEAR(place.base_in_marker_m.z(), rig.instruments[0].marker.length_m() + 0.0205, 1e-9);
  EXPECT_NEAR(std::sqrt(place.covariance(2, 2)), 0.05e-3, 1e-7);
}

TEST_F(CalibrateTipTool, FindsAWristByTouchesFromEitherCornerOfAChessboard) {
  constexpr std::uint64_t seed = 5;
  Rig rig = rig_without_tool(seed);
  const Tool truth = true_tool(seed, rig.instruments[0].marker, true);
  rig.instruments[0].tool = unplaced(truth);
  testing::write_file("rig.yaml", rig_yaml(rig));
  std::string table = "file,column,row,wrist_pitch,wrist_yaw\nboard.png,,,,\n", turned = table;
  int count = 0;
  const cv::Mat board = show_touches(seed, truth, 12, [&](const ShownTouch& touch) {
    const std::string name = "touch" + std::to_string(count++) + ".png";
    write_image(name, touch.image);
    table += fmt::format("{},{},{},{},{}\n", name, touch.column, touch.row, touch.wrist_rad[0], touch.wrist_rad[1]);
    turned +=
        fmt::format("{},{},{},{},{}\n", name, 8 - touch.column, 5 - touch.row, touch.wrist_rad[0], touch.wrist_rad[1]);
  });
  write_image("board.png", board);
  testing::write_file("touches.csv", table), testing::write_file("turned.csv", turned);
  const std::string to = " --board 9x6 --square-mm 5 --rig rig.yaml --out tip.yaml";
  for (const std::string touches : {"touches.csv", "turned.csv"}) {
    expect_done("calibrate tip --touch " + touches + to);
    expect_tip("tip.yaml", truth, 0.15e-3);
  }
  const std::string wrong = testing::replaced(table, "touch3.png,7,0", "touch3.png,9,0");
  testing::write_file("wrong.csv", wrong);
  ToolTest::expect_refused("calibrate tip --touch wrong.csv" + to, {"wrong.csv", "column", "0 to 8"});
}

}  // namespace lapservo::acceptance::calibrate_tip_test
