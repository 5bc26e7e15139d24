#include "lapservo/rig/calibration_record.h"

#include <chrono>
#include <filesystem>

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal {
namespace {

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

}  // namespace
}  // namespace lapservo::internal
