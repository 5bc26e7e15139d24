// What fuzzing the rig reader (fuzz/rig_fuzz.cpp) or thinking about it has found.
#include <string>

#include <gtest/gtest.h>

#include "lapservo/rig/rig.h"
#include "lapservo/testing/input_error.h"

namespace lapservo::internal {
namespace {

std::string refusal(const std::string& yaml) {
  return testing::input_error([&] { parse_rig(yaml, "rig.yaml", "."); });
}

TEST(RigRobustness, ACameraFileWithANameThatNoFileCanHaveIsAnInputError) {
  const std::string name(300, 'a');
  EXPECT_EQ(refusal("camera: " + name), "./" + name + ": can't be opened, expected a YAML file");
}

TEST(RigRobustness, AnEndlessCameraFileIsRefused) {
  EXPECT_EQ(refusal("camera: /dev/zero"), "/dev/zero: is larger than 1 MiB, expected a YAML file");
}

}  // namespace
}  // namespace lapservo::internal
