#include "lapservo/rig/rig_updater.h"

#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/rig/rig.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal {
namespace {

constexpr auto camera =
    "image_width: 640\nimage_height: 480\nsigma_camera_matrix: {data: [1, 0, 1, 0, 1, 1, 0, 0, 0]}\n"
    "camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320, 0, 501, 240, 0, 0, 1]}\n";
constexpr auto rig_text = R"(camera: cameras/cam.yaml
instruments:
  - name: "12"
    marker:
      diameter_m: 0.0084
      bands_upper_m: [0.0035, 0.0035, 0.017]
      bands_lower_m: [0.0095, 0.0095, 0.005]
      seam_rad: 0.1
      gap_rad: 0.2
      tolerance_m: 0.0001
  - name: other
    marker:
      diameter_m: 0.0080
      hues_deg: [180, 90, 270]
      bands_upper_m: [0.0035, 0.0035, 0.017]
      bands_lower_m: [0.0095, 0.0095, 0.005]
    camera_from_rcm:
      translation_m: [-0.0778, 0.0672, 0.0592]
      quaternion_xyzw: [0.8920, -0.3695, 0.0997, 0.2408]
      sigma_translation_m: [0.0001, 0.0001, 0.0002]
    image_delay_s: 0.1
    sigma_image_delay_s: 0.002
)";

struct Files {
  testing::TemporaryFolder folder;
  Files() {
    std::filesystem::create_directories(folder / "cameras");
    std::filesystem::create_directories(folder / "elsewhere");
    testing::write_file(folder / "cameras/cam.yaml", camera);
    testing::write_file(folder / "rig.yaml", rig_text);
  }
};

TEST(UpdatedRig, ChangesOneMarkerAndNothingElse) {
  const Files files;
  Rig rig = load_rig(files.folder / "rig.yaml");
  Marker marker = rig.instruments[0].marker;
  marker.bands_upper_m = {0.0036, 0.0034, 0.017}, marker.wrap_m = 1.0 / 3e3, marker.gap_rad = 0, marker.tolerance_m = 0;
  marker.sigmas.wrap_m = 1e-6, marker.sigmas.bands_upper_m = {1e-6, 2e-6, 3e-6};
  for (const char* place : {"new.yaml", "elsewhere/new.yaml", "rig.yaml"}) {
    const auto path = files.folder / place;
    const std::string text = updated_rig_yaml(RigText::read(files.folder / "rig.yaml"), path, 0, marker);
    EXPECT_NE(text.find("sigma_translation_m: [0.0001, 0.0001, 0.0002]"), std::string::npos);
    EXPECT_NE(text.find("sigma_image_delay_s: 0.002"), std::string::npos);
    testing::write_file(path, text);
    const Rig updated = load_rig(path);
    EXPECT_EQ(updated.instruments[0].name, "12");
    const Marker& now = updated.instruments[0].marker;
    EXPECT_EQ(now.bands_upper_m, marker.bands_upper_m);
    EXPECT_EQ(now.bands_lower_m, marker.bands_lower_m);
    EXPECT_EQ(now.wrap_m, marker.wrap_m);
    EXPECT_EQ(now.gap_rad, 0);
    EXPECT_EQ(now.tolerance_m, 0);
    EXPECT_EQ(now.sigmas.wrap_m, marker.sigmas.wrap_m);
    EXPECT_EQ(now.sigmas.bands_upper_m, marker.sigmas.bands_upper_m);
    EXPECT_EQ(updated.instruments[1].marker.diameter_m, rig.instruments[1].marker.diameter_m);
    EXPECT_EQ(updated.instruments[1].image_delay_s, rig.instruments[1].image_delay_s);
    EXPECT_EQ(updated.camera.fy_px, 501);
  }
}

TEST(UpdatedRig, ChangesOneRegistrationAndNothingElse) {
  const Files files;
  MeasuredRegistration measured;
  measured.camera_from_rcm = {Eigen::Quaterniond(0.3, 0.4, -0.5, 0.7).normalized(), {0.1, -1.0 / 3, 0.25}};
  measured.sigma_translation_m = {1e-5, 2e-5, 3e-5};
  const auto path = files.folder / "new.yaml";
  const auto updated = [&](std::size_t instrument) {
    const std::string text = updated_rig_yaml(RigText::read(files.folder / "rig.yaml"), path, instrument, measured);
    testing::write_file(path, text);
    return std::pair{load_rig(path), text};
  };
  const auto [rcm_only, text] = updated(1);
  const Instrument& other = rcm_only.instruments[1];
  EXPECT_EQ(other.camera_from_rcm->translation, measured.camera_from_rcm.translation);
  EXPECT_EQ(other.camera_from_rcm->rotation.coeffs(), measured.camera_from_rcm.rotation.coeffs());
  EXPECT_EQ(other.image_delay_s, 0.1) << "not measured: stays";
  EXPECT_EQ(text.find("sigma_translation_m: [0.0001"), std::string::npos) << "the old one's";
  EXPECT_NE(text.find("sigma_translation_m: [1e-05, 2e-05, 3e-05]"), std::string::npos);

  measured.sigma_quaternion_xyzw = {1e-4, 1e-4, 1e-4, 1e-4};
  measured.joints = Joints{{"yaw", "pitch", "insertion", "roll"}, {1, -1, 1, 1}, {0, 1.0 / 7, 0.02, -3}};
  measured.image_delay_s = 1.0 / 9, measured.sigma_image_delay_s = 0.001;
  const auto [whole, whole_text] = updated(0);
  EXPECT_EQ(whole.instruments[0].joints->offset, measured.joints->offset);
  EXPECT_EQ(whole.instruments[0].joints->sign, measured.joints->sign);
  EXPECT_EQ(whole.instruments[0].joints->names, measured.joints->names);
  EXPECT_EQ(whole.instruments[0].image_delay_s, measured.image_delay_s);
  EXPECT_EQ(whole.instruments[0].marker.gap_rad, 0.2);
  for (const char* key : {"sigma_quaternion_xyzw", "sigma_offset", "sigma_image_delay_s: 0.001"})
    EXPECT_NE(whole_text.find(key), std::string::npos) << key;
}

TEST(UpdatedRig, HoldsOtherColours) {
  const Files files;
  MeasuredColour colour{{181, 97.123456, 269.5}, {0.5, 0.512345, 1}, {}};
  const auto place = files.folder / "elsewhere/new.yaml";
  testing::write_file(place, updated_rig_yaml(RigText::read(files.folder / "rig.yaml"), place, 1, colour));
  Rig updated = load_rig(place);
  EXPECT_EQ(updated.instruments[1].marker.hues_deg, (std::array<double, 3>{181, 97.12, 269.5}));
  EXPECT_EQ((*updated.instruments[1].marker.sigmas.hues_deg)[1], 0.512);
  EXPECT_FALSE(updated.camera_file.empty()) << "as it was";

  // Another response can't go into a file that other rigs may name.
  colour.hues_deg = {90, 181, 270}, colour.response = Response{Response::Kind::power, 1.8};
  testing::write_file(place, updated_rig_yaml(RigText::read(files.folder / "rig.yaml"), place, 0, colour));
  updated = load_rig(place);
  EXPECT_TRUE(updated.camera_file.empty());
  EXPECT_EQ(updated.camera.response.gamma, 1.8);
  EXPECT_EQ(updated.camera.fx_px, 500);
  EXPECT_NE(testing::read_file(place).find("sigma_camera_matrix"), std::string::npos);
}

TEST(UpdatedRig, MayMoveAsIfMadeForThere) {
  const Files files;
  const RigText rig = RigText::read(files.folder / "rig.yaml");
  const MeasuredColour colour{{181, 97, 269.5}, {0.5, 0.5, 1}, {}};
  const RigText updated{updated_rig_yaml(rig, rig.path, 1, colour), rig.path};
  for (const char* place : {"rig.yaml", "new.yaml", "elsewhere/new.yaml"}) {
    const auto path = files.folder / place;
    const std::string moved = moved_rig_yaml(updated, path);
    EXPECT_EQ(moved, updated_rig_yaml(rig, path, 1, colour)) << place;
    EXPECT_EQ(parse_rig(moved, place, path.parent_path()).camera.fx_px, 500) << place;
  }
}

TEST(UpdatedRig, SaysNothingOfAResponseThatWasNotMeasured) {
  const Files files;
  const auto path = files.folder / "rig.yaml";
  const RigText rig = RigText::read(path);
  const std::string text = updated_rig_yaml(rig, load_rig(path).camera, {});
  EXPECT_EQ(text.find("sigma_response"), std::string::npos) << text;
  EXPECT_FALSE(is_response_measured({text, path}));
  std::string earlier = text;  // as earlier versions wrote it
  earlier.insert(earlier.find("response:"), "sigma_response: 0\n  ");
  EXPECT_FALSE(is_response_measured({earlier, path})) << earlier;
}

TEST(UpdatedRig, HoldsAnotherCamera) {
  const Files files;
  const auto path = files.folder / "rig.yaml";
  Camera measured = load_rig(path).camera;
  measured.fx_px = 501.25, measured.chromatic_aberration = {1.0004, 0.9997};
  measured.response = {Response::Kind::table, 1, {0, 0.2, 1}, {0, 0.5, 1}};
  CameraSigmas sigmas;
  sigmas.fx_px = 0.12504, sigmas.red = 1.00004e-5, sigmas.response = 0.00300004;
  const std::string text = updated_rig_yaml(RigText::read(path), measured, sigmas);
  EXPECT_NE(text.find("sigma_response: 0.003\n"), std::string::npos) << text;
  EXPECT_NE(text.find("sigma_camera_matrix: {rows: 3, cols: 3, data: [0.125,"), std::string::npos) << text;
  EXPECT_NE(text.find("sigma_lateral_chromatic_aberration: {blue: 0, red: 1e-05}"), std::string::npos) << text;
  EXPECT_NE(text.find("sigma_translation_m: [0.0001, 0.0001, 0.0002]"), std::string::npos) << text;
  EXPECT_FALSE(is_response_measured(RigText::read(path)));
  testing::write_file(path, text);
  EXPECT_TRUE(is_response_measured(RigText::read(path)));
  EXPECT_EQ(sigma_of_response(RigText::read(path)), 0.003);
  sigmas.response = 0;  // another time the pictures don't tell
  EXPECT_EQ(updated_rig_yaml(RigText::read(path), measured, sigmas), text);
  const Rig updated = load_rig(path);
  EXPECT_TRUE(updated.camera_file.empty());
  EXPECT_EQ(updated.camera.fx_px, measured.fx_px);
  EXPECT_EQ(updated.camera.chromatic_aberration, measured.chromatic_aberration);
  EXPECT_EQ(updated.camera.response.table_value, measured.response.table_value);
  EXPECT_EQ(updated.instruments[0].marker.tolerance_m, 0.0001);
}

}  // namespace
}  // namespace lapservo::internal
