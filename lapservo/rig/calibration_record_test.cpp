#include "lapservo/rig/calibration_record.h"

#include <chrono>
#include <filesystem>

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/tool/test_tools.h"

namespace lapservo::internal::calibration_record_test {

using lapservo::testing::write_file;

TEST(CalibrationRecord, ComesBackAsItWasWritten) {
  const lapservo::testing::TemporaryFolder folder;
  EXPECT_EQ(record_path(folder / "a/my.rig.yaml"), folder / "a/my.rig.calibration.yaml");
  const auto path = folder / "rig.calibration.yaml";
  EXPECT_TRUE(read_record(path).steps.empty());
  CalibrationRecord record{"fnv1a-1", {}};
  record.add(
      {"camera", "lapservo calibrate camera 'my: boards' --board 9x6", "3 files, 20 bytes, 7", "2026-01-02T03:04:05Z"});
  record.add({"marker", "lapservo calibrate marker 0", "", "2026-01-02T03:04:06Z"});
  write_record(path, record);
  const CalibrationRecord read = read_record(path);
  EXPECT_EQ(read.rig, record.rig);
  ASSERT_EQ(read.steps.size(), 2U);
  EXPECT_EQ(read.steps[0].command, record.steps[0].command);
  EXPECT_EQ(read.steps[0].inputs, record.steps[0].inputs);
  EXPECT_EQ(read.steps[1].inputs, "");
  EXPECT_EQ(read.steps[1].when, record.steps[1].when);
  write_file(path, "rig: a\nsteps:\n  - name: camera\n    commando: x\n");
  EXPECT_NE(lapservo::testing::input_error([&] { read_record(path); }).find("commando"), std::string::npos);
}

TEST(CalibrationRecord, AStepThatIsDoneTakesTheLaterOnesAlongWhetherItWasDoneBeforeOrNot) {
  for (const char* second : {"colour", "marker"}) {
    CalibrationRecord record;
    for (const char* name : {"camera", second, "check"}) record.add({name, "a", "", "b"});
    record.add({"colour", "c", "", "d"});
    ASSERT_EQ(record.steps.size(), 2U);
    EXPECT_EQ(record.steps[0].name, "camera");
    EXPECT_EQ(record.steps[1].name, "colour");
    EXPECT_EQ(record.steps[1].command, "c");
  }
}

TEST(CalibrationRecord, StatesTellWhetherFilesAreTheSame) {
  const lapservo::testing::TemporaryFolder folder;
  const auto file = folder / "a.csv";
  write_file(file, "1,2\n");
  const std::string content = content_state(file), input = input_state(file), both = input_state(folder.path());
  EXPECT_EQ(content_state(file), content);
  EXPECT_EQ(input_state(file), input);
  std::filesystem::last_write_time(file, std::filesystem::last_write_time(file) + std::chrono::seconds(1));
  EXPECT_NE(input_state(file), input);
  EXPECT_EQ(content_state(file), content);
  write_file(file, "1,3,4\n");
  EXPECT_NE(content_state(file), content);
  EXPECT_NE(input_state(file), input);
  EXPECT_NE(input_state(folder.path()), both);
  EXPECT_EQ(input_state("/dev/null"), "");
  EXPECT_EQ(content_state(folder / "nothing"), "");
}

TEST(CalibrationRecord, ARigIsAnotherOnceAFileThatItNamesIs) {
  const lapservo::testing::TemporaryFolder folder;
  const auto rig = folder / "rig.yaml";
  const std::string camera =
      "image_width: 640\nimage_height: 480\ncamera_matrix: {data: [500, 0, 319.5, 0, 500, 239.5, 0, 0, 1]}\n";
  write_file(folder / "camera.yaml", camera);
  write_file(folder / "tool.json", invented_tool_json);
  write_file(rig,
             "camera: camera.yaml\ninstruments: [{name: A, marker: {diameter_m: 0.0084, bands_upper_m: [0.0035, "
             "0.0035, 0.017], bands_lower_m: [0.0095, 0.0095, 0.005]}, tool: tool.json}]\n");
  const std::string before = rig_state(rig), content = content_state(rig);
  write_file(folder / "camera.yaml", camera + "\n");
  const std::string another_camera = rig_state(rig);
  write_file(folder / "tool.json", std::string(invented_tool_json) + "\n");
  EXPECT_NE(another_camera, before);
  EXPECT_NE(rig_state(rig), another_camera);
  EXPECT_EQ(content_state(rig), content);
}

}  // namespace lapservo::internal::calibration_record_test
