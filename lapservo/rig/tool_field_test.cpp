#include <string>

#include <gtest/gtest.h>

#include "lapservo/rig/rig.h"
#include "lapservo/rig/rig_writer.h"
#include "lapservo/testing/has.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/tool/test_tools.h"

namespace lapservo::internal::tool_field_test {
using testing::has;
using testing::input_error;

const std::string before_tool = R"(
camera: {image_width: 64, image_height: 48, camera_matrix: {data: [50, 0, 32, 0, 50, 24, 0, 0, 1]}}
instruments:
  - name: tool
    marker: {diameter_m: 0.005, bands_upper_m: [0.003, 0.003, 0.009], bands_lower_m: [0.006, 0.006, 0.003]}
    tool: )";

const std::string wrist =
    "joints: [{name: wrist_pitch, alpha_rad: -1.5707963}, {name: wrist_yaw, a_m: 0.009}], "
    "tip_in_last_joint_m: [0, 0.01, 0], ";

Tool parsed(const std::string& tool, const std::filesystem::path& folder = ".") {
  return parse_rig(before_tool + tool + "\n", "rig.yaml", folder).instruments.at(0).tool.value();
}
std::string error_of(const std::string& tool) {
  return input_error([&] { parsed(tool); });
}

TEST(ToolField, StraightToolIsWhereItsTipIs) {
  const Tool tool = parsed("{tip_in_marker_m: [0, 1e-4, 0.12], sigma_tip_in_marker_m: [1e-4, 2e-4, 5e-4]}");
  EXPECT_TRUE(tool.wrist.empty());
  EXPECT_EQ(tool.place.value().base_in_marker_m, Eigen::Vector3d(0, 1e-4, 0.12));
  EXPECT_EQ(tool.place->covariance(2, 2), 5e-4 * 5e-4);
  EXPECT_EQ(tool.place->covariance(0, 1), 0);
}

TEST(ToolField, WristHasAPlaceOffsetsAndSigmas) {
  const Tool tool =
      parsed("{" + wrist +
             "wrist_in_marker_m: [0, 0, 0.05], azimuth_rad: 0.5, sigma_azimuth_rad: 0.01, "
             "offset_rad: [0.1, 0.2], sigma_offset_rad: [0.001, 0.002], sigma_reading_rad: [0.03, 0.04]}");
  ASSERT_EQ(tool.wrist.size(), 2);
  EXPECT_EQ(tool.wrist[1].name, "wrist_yaw");
  EXPECT_EQ(tool.wrist[1].a_m, 0.009);
  EXPECT_EQ(tool.wrist[0].offset_rad, 0.1);
  EXPECT_EQ(tool.wrist[1].sigma_reading_rad, 0.04);
  EXPECT_EQ(tool.place.value().covariance(3, 3), 0.01 * 0.01);
  EXPECT_EQ(tool.place->covariance(5, 5), 0.002 * 0.002);
}

TEST(ToolField, DvrksFileIsFoundFromTheRig) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "invented.json", invented_tool_json);
  const Tool alone = parsed("invented.json", folder.path());
  EXPECT_EQ(alone.wrist, parse_dvrk_tool(invented_tool_json, "").wrist);
  EXPECT_EQ(alone.file, folder / "invented.json");
  EXPECT_FALSE(alone.place);
  const Tool placed = parsed("{file: invented.json, wrist_in_marker_m: [0, 0, 0.05], azimuth_rad: 0.5}", folder.path());
  EXPECT_EQ(placed.last_from_tip, alone.last_from_tip);
  EXPECT_EQ(placed.place.value().azimuth_rad, 0.5);
  const Tool longer = parsed("{file: invented.json, tip_in_last_joint_m: [0, 0.02, 0]}", folder.path());
  EXPECT_EQ(longer.last_from_tip, (Rigid3{alone.last_from_tip.rotation, {0, 0.02, 0}}));
}

TEST(ToolField, IsWrittenAsItIsRead) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "invented.json", invented_tool_json);
  const std::string straight = "{tip_in_marker_m: [0, 0.1, 0.2], covariance: {data: [3, 1, 0, 1, 2, 0, 0, 0, 1e-17]}}";
  const std::string longer = "{file: invented.json, tip_in_last_joint_m: [0, 0.02, 0]}";
  for (const std::string& text : {straight, std::string("invented.json"), longer}) {
    Rig rig = parse_rig(before_tool + text + "\n", "rig.yaml", folder.path());
    EXPECT_EQ(parse_rig(rig_yaml(rig, folder / "other.yaml"), "other.yaml", folder.path()), rig) << text;
    const Tool given = placed_tool();
    if (!rig.instruments[0].tool->wrist.empty()) rig.instruments[0].tool = given;
    EXPECT_EQ(parse_rig(rig_yaml(rig), "copy.yaml"), rig) << text;
  }
}

TEST(ToolField, RefusesWhatIsImplausible) {
  EXPECT_TRUE(has(error_of("{tip_in_marker_m: [0, 0, 120]}"), "look like millimetres"));
  EXPECT_TRUE(has(error_of("{tip_in_marker_m: [0, 0, 0.1], length: 3}"), "unknown"));
  EXPECT_TRUE(has(error_of("{tip_in_marker_m: [0, 0, 0.1], covariance: {data: [1, 2, 0, 0, 1, 0, 0, 0, 1]}}"), "symm"));
  EXPECT_TRUE(has(error_of("{" + wrist + "wrist_in_marker_m: [0, 0, 0.05]}"), "azimuth_rad: is missing"));
  EXPECT_TRUE(has(error_of("{" + wrist + "azimuth_rad: 0.5}"), "wrist_in_marker_m beside it"));
  EXPECT_TRUE(has(error_of("{" + wrist + "offset_rad: [3, 90]}"), "look like degrees"));
  EXPECT_TRUE(has(error_of("{" + wrist + "offset_rad: [3]}"), "one for each joint"));
  EXPECT_TRUE(has(error_of("{" + wrist + "sigma_reading_rad: [0.1, -0.1]}"), "standard dev"));
  EXPECT_TRUE(has(error_of("{joints: [], tip_in_last_joint_m: [0, 0, 0]}"), "one to four"));
  EXPECT_NE(error_of("{}"), "");
  EXPECT_TRUE(has(error_of("nowhere.json"), "nowhere.json"));
}

}  // namespace lapservo::internal::tool_field_test
