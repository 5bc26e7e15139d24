#include "lapservo/crtk/arm_limits.h"

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"
#include "lapservo/testing/sample_frames.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal {
namespace {

TEST(ArmLimits, TheReadyFilesAreRead) {
  for (const char* name : {"psm-classic.yaml", "psm-si.yaml"}) {
    const JointLimits limits = load_arm_limits(testing::source_folder() / "configs/joint_limits" / name);
    EXPECT_TRUE((limits.lower.array() < limits.upper.array()).all()) << name;
    EXPECT_NEAR(limits.lower[2], 0.01, 1e-12) << name;
  }
}

TEST(ArmLimits, WrongOnesAreRefusedByName) {
  const testing::TemporaryFolder folder;
  const auto complaint = [&](const std::string& text) {
    testing::write_file(folder / "limits.yaml", text);
    return testing::input_error([&] { load_arm_limits(folder / "limits.yaml"); });
  };
  const std::string rates = "rate: [1, 1, 1, 1]\nacceleration: [1, 1, 1, 1]\n";
  EXPECT_NE(complaint("lower: [0, 0, 0]\nupper: [1, 1, 1, 1]\n" + rates).find(": lower: "), std::string::npos);
  EXPECT_NE(complaint("lower: [0, 2, 0, 0]\nupper: [1, 1, 1, 1]\n" + rates).find(": upper: "), std::string::npos);
  EXPECT_NE(complaint("lower: [0, 0, 0, 0]\nupper: [1, 1, 1, 1]\nrate: [1, 0, 1, 1]\nacceleration: [1, 1, 1, 1]\n")
                .find(": rate: "),
            std::string::npos);
  EXPECT_NE(complaint("lower: [0, 0, 0, 0]\n" + rates).find(": upper: "), std::string::npos);
  EXPECT_NE(complaint("lower: [-85, -50, 0, -260]\nupper: [85, 50, 0.2, 260]\n" + rates).find("-85 looks like degrees"),
            std::string::npos);
  EXPECT_NE(complaint("lower: [-1, -1, 10, -4]\nupper: [1, 1, 240, 4]\n" + rates).find("10 looks like millimetres"),
            std::string::npos);
  EXPECT_NE(complaint("lower: [0, 0, 0, 0]\nupper: [1, 1, 1, 1]\nrate: [20, 1, 1, 1]\nacceleration: [1, 1, 1, 1]\n")
                .find("rate: is a list of 4, expected radians within 10 for number 1: 20 looks like degrees"),
            std::string::npos);
  EXPECT_NE(complaint("lowr: [0, 0, 0, 0]\n" + rates).find("lowr"), std::string::npos);
}

}  // namespace
}  // namespace lapservo::internal
