#include "lapservo/rig/camera_formats.h"

#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "lapservo/rig/rig.h"
#include "lapservo/testing/has.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::camera_formats_test {
using testing::replaced;

constexpr auto opencv = R"(%YAML:1.0
---
calibration_time: "Wed 25 Nov 2026"
image_width: 640
image_height: 480
board_width: 9
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 500., 0., 320.5, 0., 510., 240.25, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix { rows: 5, cols: 1, dt: d, data: [ -1.5e-01, 0.02, 0.001, -0.002, 0. ] }
avg_reprojection_error: 0.2
)";

constexpr auto ros1 = R"(header: 
  seq: 12
  frame_id: "endoscope"
height: 480
width: 640
distortion_model: "plumb_bob"
D: [-0.15, 0.02, 0.001, -0.002, 0.0]
K: [500.0, 0.0, 320.5, 0.0, 510.0, 240.25, 0.0, 0.0, 1.0]
R: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
P: [500.0, 0.0, 320.5, 0.0, 0.0, 510.0, 240.25, 0.0, 0.0, 0.0, 1.0, 0.0]
binning_x: 0
binning_y: 0
---
header:
  seq: 13
---
)";

constexpr auto ros2 = R"(header:
  frame_id: endoscope
height: 480
width: 640
distortion_model: rational_polynomial
d: [-0.15, 0.02, 0.001, -0.002, 0.0, 0.0, 0.0, 0.0]
k: [500.0, 0.0, 320.5, 0.0, 510.0, 240.25, 0.0, 0.0, 1.0]
---
)";

constexpr auto kalibr = R"(cam0:
  cam_overlaps: []
  camera_model: pinhole
  distortion_coeffs: [-0.15, 0.02, 0.001, -0.002]
  distortion_model: radtan
  intrinsics: [500.0, 510.0, 320.5, 240.25]
  resolution: [640, 480]
  rostopic: /endoscope/image_raw
)";

constexpr auto rig = R"(camera: camera.yaml
instruments:
  - name: PSM1
    marker: {diameter_m: 0.0084, bands_upper_m: [0.0035, 0.0035, 0.017], bands_lower_m: [0.0095, 0.0095, 0.005]}
)";

Camera camera_of(const std::string& text) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "camera.yaml", text);
  return parse_rig(rig, "rig.yaml", folder.path()).camera;
}

void expect_refused(const std::string& text, const std::string& why) {
  EXPECT_TRUE(testing::has(testing::input_error([&] { camera_of(text); }), why));
}

TEST(CameraFormats, OfOtherProgramsGiveTheSameCameraAndOurOwnStayAsTheyAre) {
  const std::string own = "image_width: 640\nimage_height: 480\n";
  EXPECT_EQ(with_rig_keys(own, "camera.yaml"), own);
  for (const char* text : {opencv, ros1, ros2, kalibr}) {
    const Camera expected{640, 480, 500, 510, 320.5, 240.25, {-0.15, 0.02, 0.001, -0.002, 0}, {}};
    EXPECT_EQ(camera_of(text), expected) << text;
  }
}

TEST(CameraFormats, OfOtherProgramsMayHaveTheKeysOfOurOwnAndNoUnknownOnes) {
  for (const auto& [text, line] : {std::pair{opencv, "image_height: 480"},
                                   {ros1, "height: 480"},
                                   {ros2, "height: 480"},
                                   {kalibr, "cam0:"},
                                   {kalibr, "  resolution: [640, 480]"}}) {
    const std::string file = text, place = line, indent = place.substr(0, place.find_first_not_of(' '));
    const auto with = [&](const std::string& key) { return replaced(file, place, indent + key + "\n" + place); };
    EXPECT_EQ(camera_of(with("response: {light: [0, 0.2, 1], value: [0, 0.5, 1]}")).response.table_light.size(), 3U);
    expect_refused(with("respons: linear"), "respons: is unknown, expected a known key, of which response is");
    expect_refused(with("binning_x: 2"), "binning_x");
    expect_refused(with("roi: {x_offset: 100}"), "roi.x_offset: is 100, expected 0: a camera_matrix of the pixels");
  }
}

TEST(CameraFormats, ThatLackNumbersOrHoldSeveralCamerasAreRefused) {
  expect_refused(std::string(kalibr) + "cam1: {}\n", "several cameras");
  expect_refused(replaced(opencv, "image_width: 640\nimage_height: 480\n", ""),
                 "an OpenCV calibration without image_width, image_height");
}

TEST(CameraFormats, OfCamerasThatAreNotModelledAreRefused) {
  const auto expect_remedy = [](const std::string& text, const std::string& why) {
    expect_refused(text, why);
    expect_refused(text, "lapservo calibrate camera");
  };
  expect_remedy(replaced(ros1, "500.0, 0.0, 320.5, 0.0, 510.0, 240.25, 0.0, 0.0, 1.0",
                         "0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0"),
                "not calibrated");
  expect_remedy(replaced(ros1, "\"plumb_bob\"", "equidistant"), "equidistant");
  expect_remedy(replaced(kalibr, "radtan", "equidistant"), "equidistant");
  expect_remedy(replaced(kalibr, "pinhole", "omni"), "omni");
  expect_remedy(replaced(opencv, "board_width: 9", "fisheye_model: 1"), "fisheye");
  expect_remedy(replaced(ros2, "0.0]\nk:", "0.3]\nk:"), "rational");
}

}  // namespace lapservo::internal::camera_formats_test
