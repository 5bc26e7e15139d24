#include "lapservo/rig/rig_writer.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/rig/rig.h"
#include "lapservo/testing/has.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/tool/test_tools.h"

namespace lapservo::internal::rig_writer_test {
using testing::has;
using testing::input_error;

constexpr auto every_key = R"(camera:
  image_width: 640
  image_height: 480
  distortion_model: plumb_bob
  camera_matrix: {rows: 3, cols: 3, data: [500.25, 0, 320, 0, 501, 240, 0, 0, 1]}
  sigma_camera_matrix: {rows: 3, cols: 3, data: [0.1, 0, 0.2, 0, 0.3, 0.4, 0, 0, 0]}
  distortion_coefficients: {rows: 1, cols: 5, data: [-0.1, 0.02, 0.001, -0.002, 1.0e-17]}
  sigma_distortion_coefficients: {rows: 1, cols: 5, data: [0.01, 0.02, 0.03, 0.04, 0.05]}
  response: {light: [0, 0.2, 1], value: [0, 0.5, 1], sigma_light: [0, 0.01, 0], sigma_value: [0, 0.02, 0]}
  sigma_response: 0.003
  lateral_chromatic_aberration: {blue: 0.9993, red: 1.0007}
  sigma_lateral_chromatic_aberration: {blue: 1.0e-05, red: 2.0e-05}
  deinterlace: true
  readout_s: -0.012
instruments:
  - name: "a \"b\" \\ # : é"
    marker:
      diameter_m: 0.0084
      sigma_diameter_m: 1.0e-05
      hues_deg: [90.1, 180.2, 270.3]
      sigma_hues_deg: [0.5, 0.25, 1]
      bands_upper_m: [0.0035, 0.0036, 0.0169]
      sigma_bands_upper_m: [1.0e-06, 2.0e-06, 3.0e-06]
      bands_lower_m: [0.0095, 0.0094, 0.0053]
      sigma_bands_lower_m: [4.0e-06, 5.0e-06, 6.0e-06]
      seam_rad: 0.1
      sigma_seam_rad: 0.001
      wrap_m: 0.0003
      sigma_wrap_m: 7.0e-06
      skew_m: 0.0002
      sigma_skew_m: 8.0e-06
      gap_rad: 0.2
      sigma_gap_rad: 0.002
      tolerance_m: 0.0001
      sigma_tolerance_m: 9.0e-06
    camera_from_rcm:
      translation_m: [-0.0778, 0.0672, 0.0592]
      sigma_translation_m: [0.0001, 0.0002, 0.0003]
      quaternion_xyzw: [0, 0, 0.6, 0.8]
      sigma_quaternion_xyzw: [0.001, 0.002, 0.003, 0.004]
    joints:
      names: ["yaw", "a \"pitch\"", "insertion \\", "roll"]
      sign: [1, -1, 1, -1]
      offset: [0, 1.5, -0.0156, 2]
      sigma_offset: [0, 0.01, 0.0001, 0.02]
    image_delay_s: 0.08
    sigma_image_delay_s: 0.001
)";

Rig written_and_read(const Rig& rig) {
  return parse_rig(rig_yaml(rig), "rig.yaml");
}

TEST(RigWriter, KeepsEveryKey) {
  EXPECT_EQ(rig_yaml(parse_rig(every_key, "rig.yaml")), every_key);
}

Response random_response(Random& random) {
  const double bend = random.uniform(0.1, 0.9);
  const std::array<Response, 5> all{Response{},
                                    {Response::Kind::rec709},
                                    {Response::Kind::power, 1},
                                    {Response::Kind::power, random.uniform(0.3, 4)},
                                    {Response::Kind::table, 1, {0, bend, 1}, {0, 1 - bend / 3, 1}}};
  return all.at(random.bits() % all.size());
}

template <int size>
Eigen::Matrix<double, size, size> random_covariance(Random& random) {
  Eigen::Matrix<double, size, size> root;
  for (double& number : root.reshaped()) number = 1e-3 * random.normal();
  const Eigen::Matrix<double, size, size> square = root * root.transpose();
  return (square + square.transpose()) / 2;
}

TEST(RigWriter, WhatItWritesReadsBackToTheLastBit) {
  Random random(1);
  for (int i = 0; i < 300; ++i) {
    Rig rig = parse_rig(every_key, "rig.yaml");
    rig.camera.fx_px = random.uniform(500, 2000), rig.camera.cy_px = random.uniform(200, 300);
    rig.camera.distortion = {random.uniform(-0.05, 0.05), 1e-17, 0, -0.0, random.uniform(-1e-9, 1e-9)};
    rig.camera.response = random_response(random);
    Instrument& instrument = rig.instruments[0];
    instrument.marker.seam_rad = random.uniform(-3, 3), instrument.marker.wrap_m = random.uniform(-2e-3, 2e-3);
    if (i % 2 != 0) instrument.marker.sigmas = {};
    instrument.camera_from_rcm = {
        Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), random.normal()).normalized(),
        {random.uniform(-1, 1), 1.0 / 3, -0.0}};
    instrument.registration_covariance = random_covariance<6>(random);
    if (i % 2 != 0) rig.camera.covariance = random_covariance<9>(random);
    instrument.joints->offset = {0, 1.0 / 3, -0.0, random.normal()};
    ASSERT_EQ(written_and_read(rig), rig) << rig_yaml(rig);
  }
}

// Keys, their sigmas and whole maps: where the rest is a rig.
TEST(RigWriter, WhatARigLeavesOutStaysLeftOut) {
  std::vector<std::string> lines;
  std::istringstream text(every_key);
  for (std::string line; std::getline(text, line);) lines.push_back(line + "\n");
  int rigs = 0;
  for (std::size_t first = 0; first < lines.size(); ++first)
    for (std::size_t after = first + 1; after <= std::min(first + 6, lines.size()); ++after) {
      std::string rest;
      for (std::size_t i = 0; i < lines.size(); ++i) rest += i >= first && i < after ? "" : lines[i];
      if (!input_error([&] { parse_rig(rest, "rig.yaml"); }).empty()) continue;
      ++rigs;
      const Rig rig = parse_rig(rest, "rig.yaml");
      EXPECT_EQ(written_and_read(rig), rig) << rest;
    }
  EXPECT_GT(rigs, 20) << "the test's own power";
}

TEST(RigWriter, NamesACamerasFileFromWhereverTheRigGoes) {
  const testing::TemporaryFolder folder;
  std::filesystem::create_directories(folder / "home/lenses");
  std::filesystem::create_directory_symlink("lenses", folder / "home/cameras");
  std::filesystem::create_symlink("v3.yaml", folder / "home/lenses/a: b.yaml");
  std::filesystem::create_symlink("home/lenses/linked.yaml", folder / "link.yaml");
  const std::string text = every_key;
  const std::size_t instruments = text.find("instruments:");
  const Camera camera = parse_rig(every_key, "rig.yaml").camera;
  testing::write_file(folder / "home/lenses/v3.yaml", camera_yaml(camera));
  testing::write_file(folder / "home/rig.yaml", "camera: 'cameras/a: b.yaml'\n" + text.substr(instruments));
  const Rig rig = load_rig(folder / "home/rig.yaml");
  EXPECT_EQ(rig.camera, camera);
  for (const char* place : {"home/rig.yaml", "home/new.yaml", "away.yaml", "home/cameras/new.yaml", "link.yaml"}) {
    const auto path = folder / place;
    testing::write_file(path, rig_yaml(rig, path));
    for (const auto& name : {path, std::filesystem::canonical(path)}) {
      const Rig moved = load_rig(name);
      EXPECT_TRUE(std::filesystem::equivalent(moved.camera_file, rig.camera_file)) << name;
      EXPECT_EQ(moved.camera_file.filename(), "a: b.yaml") << name;
      EXPECT_EQ(moved.camera, camera) << name;
      EXPECT_EQ(moved.instruments, rig.instruments) << name;
    }
  }
  EXPECT_TRUE(has(testing::read_file(folder / "away.yaml"), "home/cameras/a: b.yaml"));
  EXPECT_EQ(rig_yaml(rig), every_key) << "on its own";
}

TEST(RigWriter, ReplacesNoFileOfACameraOrATool) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "camera.yaml", camera_yaml(parse_rig(every_key, "rig.yaml").camera));
  testing::write_file(folder / "tool.json", invented_tool_json);
  testing::write_file(folder / "rig.yaml", every_key);
  std::filesystem::create_symlink("camera.yaml", folder / "link.yaml");
  for (const char* part : {"camera.yaml", "tool.json", "link.yaml"})
    EXPECT_TRUE(has(input_error([&] { refuse_rig_over_part(folder / part); }), "rig would replace")) << part;
  for (const char* place : {"rig.yaml", "new.yaml", "."}) EXPECT_NO_THROW(refuse_rig_over_part(folder / place));
  EXPECT_TRUE(has(input_error([&] { refuse_part_over_rig(folder / "rig.yaml", "camera"); }), "is a rig"));
  for (const char* place : {"camera.yaml", "tool.json", "new.yaml", "."})
    EXPECT_NO_THROW(refuse_part_over_rig(folder / place, "camera"));
}

}  // namespace lapservo::internal::rig_writer_test
