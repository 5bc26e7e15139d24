#include "lapservo/core/error.h"

#include <string>

#include <gtest/gtest.h>

namespace lapservo::internal::error_test {

TEST(InputError, KeepsItsFieldsAsTheyWereGiven) {
  const std::string longer_than_shown(100, 'x');
  const InputError error("a: b.yaml", "instruments[0].name", longer_than_shown, "a name");
  EXPECT_EQ(error.source(), "a: b.yaml");
  EXPECT_EQ(error.field(), "instruments[0].name");
  EXPECT_EQ(error.value(), longer_than_shown);
  EXPECT_EQ(error.expectation(), "a name");
  EXPECT_EQ(error.problem(), "");
  EXPECT_EQ(error.what(), "a: b.yaml: instruments[0].name: is " + std::string(80, 'x') + "..., expected a name");
}

// Whatever its text looks like: nothing is read out of the message.
TEST(InputError, SaysTheSameOfAnotherSource) {
  const InputError fields("rig", "rig: camera", "rig: 3", "another");
  EXPECT_STREQ(fields.with_source("mine.yaml").what(), "mine.yaml: rig: camera: is rig: 3, expected another");
  const InputError problem("rig", "rig: is wrong");
  EXPECT_STREQ(problem.with_source("mine.yaml").what(), "mine.yaml: rig: is wrong");
}

}  // namespace lapservo::internal::error_test
