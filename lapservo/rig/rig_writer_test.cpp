#include "lapservo/rig/rig_writer.h"

#include <string>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/rig/rig.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal {
namespace {

constexpr auto markers = R"(instruments:
  - name: "a \"b\" \\ # : é"
    marker:
      diameter_m: 0.00841
      hues_deg: [90.1, 180.2, 270.3]
      bands_upper_m: [0.0035, 0.0036, 0.0169]
      bands_lower_m: [0.0095, 0.0094, 0.0051]
      seam_rad: 0.1
)";

void expect_same_bits(const Rig& a, const Rig& b) {
  EXPECT_EQ(a.camera.width_px, b.camera.width_px);
  EXPECT_EQ(a.camera.height_px, b.camera.height_px);
  for (const auto member : {&Camera::fx_px, &Camera::fy_px, &Camera::cx_px, &Camera::cy_px})
    EXPECT_EQ(a.camera.*member, b.camera.*member);
  EXPECT_EQ(a.camera.distortion, b.camera.distortion);
  EXPECT_EQ(a.camera.deinterlace, b.camera.deinterlace);
  EXPECT_EQ(a.camera.chromatic_aberration, b.camera.chromatic_aberration);
  EXPECT_EQ(a.camera.response.kind, b.camera.response.kind);
  EXPECT_EQ(a.camera.response.gamma, b.camera.response.gamma);
  EXPECT_EQ(a.camera.response.table_light, b.camera.response.table_light);
  EXPECT_EQ(a.camera.response.table_value, b.camera.response.table_value);
  ASSERT_EQ(a.instruments.size(), b.instruments.size());
  for (std::size_t i = 0; i < a.instruments.size(); ++i) {
    const Instrument &left = a.instruments[i], &right = b.instruments[i];
    EXPECT_EQ(left.name, right.name);
    EXPECT_EQ(left.marker.diameter_m, right.marker.diameter_m);
    EXPECT_EQ(left.marker.hues_deg, right.marker.hues_deg);
    EXPECT_EQ(left.marker.bands_upper_m, right.marker.bands_upper_m);
    EXPECT_EQ(left.marker.bands_lower_m, right.marker.bands_lower_m);
    EXPECT_EQ(left.marker.seam_rad, right.marker.seam_rad);
    EXPECT_EQ(left.marker.tolerance_m, right.marker.tolerance_m);
    for (const auto member : {&Marker::wrap_m, &Marker::skew_m, &Marker::gap_rad})
      EXPECT_EQ(left.marker.*member, right.marker.*member);
    const MarkerSigmas &of_left = left.marker.sigmas, &of_right = right.marker.sigmas;
    for (const auto member : {&MarkerSigmas::diameter_m, &MarkerSigmas::seam_rad, &MarkerSigmas::wrap_m,
                              &MarkerSigmas::skew_m, &MarkerSigmas::gap_rad})
      EXPECT_EQ(of_left.*member, of_right.*member);
    for (const auto member : {&MarkerSigmas::hues_deg, &MarkerSigmas::bands_upper_m, &MarkerSigmas::bands_lower_m})
      EXPECT_EQ(of_left.*member, of_right.*member);
    EXPECT_EQ(left.image_delay_s, right.image_delay_s);
    ASSERT_EQ(left.joints.has_value(), right.joints.has_value());
    if (left.joints) {
      EXPECT_EQ(left.joints->names, right.joints->names);
      EXPECT_EQ(left.joints->sign, right.joints->sign);
      EXPECT_EQ(left.joints->offset, right.joints->offset);
    }
    ASSERT_EQ(left.camera_from_rcm.has_value(), right.camera_from_rcm.has_value());
    if (!left.camera_from_rcm) continue;
    EXPECT_EQ(left.camera_from_rcm->translation, right.camera_from_rcm->translation);
    EXPECT_EQ(left.camera_from_rcm->rotation.coeffs(), right.camera_from_rcm->rotation.coeffs());
  }
}

Rig written_and_read(const Rig& rig) {
  return parse_rig(rig_yaml(rig), "rig.yaml");
}

TEST(RigWriter, WhatItWritesReadsBackToTheLastBit) {
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    Rig rig = parse_rig(std::string("camera: {image_width: 1280, image_height: 720, "
                                    "camera_matrix: {data: [1100, 0, 639.5, 0, 1090, 359.5, 0, 0, 1]}}\n") +
                            markers,
                        "rig.yaml");
    if (i % 2 == 0) rig.camera.chromatic_aberration = {random.uniform(0.99, 1.01), random.uniform(0.99, 1.01)};
    rig.camera.fx_px = random.uniform(500, 2000), rig.camera.cy_px = random.uniform(300, 400);
    rig.camera.distortion = {random.uniform(-0.05, 0.05), 1e-17, 0, -0.0, random.uniform(-1e-9, 1e-9)};
    if (i % 3 == 0) rig.camera.response = {Response::Kind::power, random.uniform(0.3, 4)};
    if (i % 3 == 1) rig.camera.response = {Response::Kind::power, 1};
    if (i % 7 == 2) rig.camera.response = {Response::Kind::rec709};
    if (i % 7 == 3) {
      const double bend = random.uniform(0.1, 0.9);
      rig.camera.response = {Response::Kind::table, 1, {0, bend, 1}, {0, 1 - bend / 3, 1}};
    }
    rig.camera.deinterlace = i % 2 == 1;
    Instrument& instrument = rig.instruments[0];
    if (i % 5 == 0)
      instrument.joints =
          Joints{{"yaw", "a \"pitch\"", "insertion \\", "roll"}, {1, -1, 1, -1}, {0, 1.0 / 3, -0.0, random.normal()}};
    if (i % 5 == 1) instrument.image_delay_s = random.uniform(0, 0.3);
    instrument.marker.seam_rad = random.uniform(-3, 3);
    instrument.marker.hues_deg[0] += random.uniform(-1, 1);
    if (i % 4 == 1) instrument.marker.tolerance_m = random.uniform(0, 1e-3);
    if (i % 4 == 2) {
      instrument.marker.wrap_m = random.uniform(-2e-3, 2e-3), instrument.marker.gap_rad = random.uniform(0, 0.3);
      instrument.marker.skew_m = random.uniform(-1e-3, 1e-3);
      instrument.marker.bands_lower_m[2] += instrument.marker.skew_m;
      MarkerSigmas& sigmas = instrument.marker.sigmas;
      sigmas.bands_upper_m = sigmas.bands_lower_m = sigmas.hues_deg = {random.uniform(), 1.0 / 3, 1e-17};
      sigmas.diameter_m = sigmas.seam_rad = sigmas.wrap_m = sigmas.skew_m = sigmas.gap_rad = random.uniform(0, 1e-3);
    }
    if (i % 4 == 3) instrument.marker.sigmas.wrap_m = 1e-5;
    if (i % 2 == 0)
      instrument.camera_from_rcm =
          Rigid3{Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), random.normal()).normalized(),
                 {random.uniform(-1, 1), 1.0 / 3, -0.0}};
    expect_same_bits(rig, written_and_read(rig));
  }
}

TEST(RigWriter, ARigWhoseCameraHasAFileStandsOnItsOwn) {
  const testing::TemporaryFolder folder;
  testing::write_file(
      folder / "cam.yaml",
      "image_width: 640\nimage_height: 480\ncamera_matrix: {data: [500, 0, 320, 0, 501, 240, 0, 0, 1]}\n"
      "distortion_coefficients: {data: [-0.1, 0.02, 0.001, -0.002, 0]}\nresponse: linear\n");
  testing::write_file(folder / "rig.yaml", std::string("camera: cam.yaml\n") + markers);
  const Rig rig = load_rig(folder / "rig.yaml");
  EXPECT_EQ(rig.camera_file, folder / "cam.yaml");
  expect_same_bits(rig, written_and_read(rig));
  EXPECT_EQ(written_and_read(rig).camera_file, "");
}

}  // namespace
}  // namespace lapservo::internal
