#include "lapservo/crtk/arm_limits.h"

#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"
#include "lapservo/testing/sample_frames.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::arm_limits_test {

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
  const std::string places = "lower: [0, 0, 0, 0]\nupper: [1, 1, 1, 1]\n",
                    acceleration = "acceleration: [1, 1, 1, 1]\n", rates = "rate: [1, 1, 1, 1]\n" + acceleration;
  for (const auto& [text, said] :
       {std::pair{"lower: [0, 0, 0]\nupper: [1, 1, 1, 1]\n" + rates, ": lower: "},
        {"lower: [0, 2, 0, 0]\nupper: [1, 1, 1, 1]\n" + rates, ": upper: "},
        {places + "rate: [1, 0, 1, 1]\n" + acceleration, ": rate: "},
        {"lower: [0, 0, 0, 0]\n" + rates, ": upper: "},
        {"lower: [-85, -50, 0, -260]\nupper: [85, 50, 0.2, 260]\n" + rates, "-85 looks like degrees"},
        {"lower: [-1, -1, 10, -4]\nupper: [1, 1, 240, 4]\n" + rates, "10 looks like millimetres"},
        {places + "rate: [20, 1, 1, 1]\n" + acceleration,
         "rate: is a list of 4, expected radians within 10 for number 1: 20 looks like degrees"},
        {"lowr: [0, 0, 0, 0]\n" + rates, "lowr"}})
    EXPECT_NE(complaint(text).find(said), std::string::npos) << text;
}

}  // namespace lapservo::internal::arm_limits_test
