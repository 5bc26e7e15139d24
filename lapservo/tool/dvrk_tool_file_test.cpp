#include "lapservo/tool/dvrk_tool_file.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/core/yaml_field.h"
#include "lapservo/testing/has.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/tool/test_tools.h"

namespace lapservo::internal::dvrk_tool_file_test {
namespace fs = std::filesystem;
using testing::has;
using testing::input_error;

// A row of the file and its link by cisstRobot's robModifiedDH, to which the joint's offset and value are added.
struct Row {
  double alpha, a, theta, d, offset;

  Eigen::Matrix4d link(double q) const {
    const double ca = std::cos(alpha), sa = std::sin(alpha);
    const double ct = std::cos(theta + offset + q), st = std::sin(theta + offset + q);
    Eigen::Matrix4d link;
    link << ct, -st, 0, a, st * ca, ct * ca, -sa, -sa * d, st * sa, ct * sa, ca, ca * d, 0, 0, 0, 1;
    return link;
  }
};

struct Chain {
  std::vector<Row> rows;
  Eigen::Matrix4d tip;
};

Tool placed_at_the_marker(Tool tool) {
  tool.place.emplace();
  return tool;
}

void expect_agreement(const Chain& chain, const Tool& tool, Random& random) {
  ASSERT_EQ(tool.wrist.size(), chain.rows.size());
  for (int i = 0; i < 20; ++i) {
    std::vector<double> wrist;
    Eigen::Matrix4d expected = Eigen::Matrix4d::Identity();
    for (const Row& row : chain.rows) wrist.push_back(random.uniform(-1.4, 1.4)), expected *= row.link(wrist.back());
    expected *= chain.tip;
    const Rigid3 found = tip_in_marker(tool, wrist).marker_from_tip;
    EXPECT_LT((found.translation - expected.topRightCorner<3, 1>()).norm(), 1e-9);
    // 0.7071 of a file's rotation is no exact one.
    const double digits =
        chain.tip.cwiseAbs().isApprox(chain.tip.cwiseAbs().array().round().matrix(), 0.1) ? 1e-9 : 1e-4;
    EXPECT_LT((found.rotation.toRotationMatrix() - expected.topLeftCorner<3, 3>()).cwiseAbs().maxCoeff(), digits);
  }
}

std::string changed(const std::string& old_text, const std::string& new_text) {
  return testing::replaced(std::string(invented_tool_json), old_text, new_text);
}

TEST(DvrkToolFile, HasThePoseThatDvrkComputes) {
  constexpr double right = std::numbers::pi / 2;
  Chain chain{{{-right, 0, 0, 0, -1.5708}, {-right, 0.0085, 0.1, 0.001, -1.5}}, {}};
  chain.tip << 0, -1, 0, 0, 0, 0, 1, 0.010, -1, 0, 0, 0, 0, 0, 0, 1;
  const Tool tool = parse_dvrk_tool(invented_tool_json, "invented.json");
  EXPECT_EQ(tool.wrist[0].name, "wrist_pitch");
  EXPECT_EQ(tool.wrist[1].sigma_reading_rad, std::numbers::pi / 180);
  EXPECT_FALSE(tool.snake_like);
  EXPECT_FALSE(tool.place);
  EXPECT_EQ(parse_dvrk_tool(changed("tooltip_offset", "tooltip-offset"), "before_2_4.json"), tool);
  Random random(1);
  expect_agreement(chain, placed_at_the_marker(tool), random);
}

TEST(DvrkToolFile, ThatEndsOnAnAxisNamesTheKeyThatMovesItsTip) {
  Tool tool = parse_dvrk_tool(changed("0.010]", "0.000]"), "tool.json");
  EXPECT_EQ(axis_tip_text(tool), "");  // the tip of a rig's own `joints` is where the rig says
  tool.file = "folder/tool.json";
  const std::string text = axis_tip_text(tool);
  EXPECT_TRUE(has(text, "on the axis of wrist_yaw, where tool.json ends")) << text;
  EXPECT_TRUE(has(text, "tip_in_last_joint_m: [0, 0.01, 0]")) << text;
  tool.last_from_tip.translation.y() = 0.01;
  EXPECT_EQ(axis_tip_text(tool), "");
}

TEST(DvrkToolFile, RefusesOthersAndNamesTheField) {
  const auto error_of = [](const std::string& json) {
    return input_error([&] { parse_dvrk_tool(json, "tool.json"); });
  };
  EXPECT_NE(error_of(changed("\"modified\"", "\"standard\"")).find("DH.convention: is standard"), std::string::npos);
  EXPECT_NE(error_of(changed("0.0085", "8.5")).find("DH.joints[2].A: is 8.5, expected metres"), std::string::npos);
  EXPECT_NE(error_of(changed("-1.5\n", "-90\n")).find("joints[2].offset: is -90, expected rad"), std::string::npos);
  EXPECT_NE(error_of(changed("wrist_yaw", "wrist_pitch")).find("joints[2].name"), std::string::npos);
  EXPECT_NE(error_of(changed("\"alpha\":  0.0000", "\"alpha\": 0.1")).find("not about the shaft"), std::string::npos);
  EXPECT_NE(error_of(changed("[-1.0,", "[-2.0,")).find("tooltip_offset"), std::string::npos);
  EXPECT_NE(error_of(changed("tooltip_offset", "offset")).find("tooltip_offset: is missing"), std::string::npos);
  EXPECT_NE(error_of(changed("\"jaw\"", "\"tooltip-offset\"")).find("tooltip-offset: is beside tooltip_offset"),
            std::string::npos);
  EXPECT_NE(error_of(changed("\"DH\"", "\"links\"")).find("DH: is missing"), std::string::npos);
  EXPECT_NE(error_of("[1, 2]"), "");
  EXPECT_NE(error_of("/* {}"), "");
}

double number_after(const YamlField& joint, const char* key) {
  return joint[key].number("a number");
}

// By a reader of its own: comments cut line by line.
Chain chain_in(const fs::path& path) {
  std::string text = read_yaml(path), json;
  text.erase(0, text.find('{'));
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string line = text.substr(at, end - at);
    json += line.substr(0, line.find("//")) + "\n";
    at = end + 1;
  }
  const YamlField root = YamlField::parse(json, path.string(), "tool file");
  Chain chain;
  for (const YamlField& joint : root["DH"]["joints"].list("joints")) {
    double alpha = number_after(joint, "alpha");
    if (alpha == -1.5708) alpha = -std::numbers::pi / 2;
    if (alpha == 1.5708) alpha = std::numbers::pi / 2;
    chain.rows.push_back({alpha, number_after(joint, "A"), number_after(joint, "theta"), number_after(joint, "D"),
                          number_after(joint, "offset")});
  }
  chain.rows.erase(chain.rows.begin());  // roll
  const bool is_new = root["tooltip_offset"].present();
  const auto rows = root[is_new ? "tooltip_offset" : "tooltip-offset"].list("rows");
  for (int i = 0; i < 4; ++i) chain.tip.row(i) = Eigen::RowVector4d(rows[i].numbers<4>("numbers").data());
  return chain;
}

TEST(DvrkToolFile, EveryOneOfDvrkIsRead) {
  const char* folder = std::getenv("LAPSERVO_DVRK_TOOLS");
  if (!folder) GTEST_SKIP() << "LAPSERVO_DVRK_TOOLS names no folder of dVRK's tool files";
  Random random(2);
  int files = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() != ".json" || entry.path().filename() == "index.json") continue;
    SCOPED_TRACE(entry.path().filename().string());
    const Tool tool = read_dvrk_tool(entry.path());
    EXPECT_EQ(tool.file, entry.path());
    EXPECT_EQ(tool.snake_like, tool.wrist.size() == 4);
    expect_agreement(chain_in(entry.path()), placed_at_the_marker(tool), random);
    ++files;
  }
  RecordProperty("files", files);
  EXPECT_GT(files, 0);
}

}  // namespace lapservo::internal::dvrk_tool_file_test
