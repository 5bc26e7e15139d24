#include "transports/ros1/ros1_names.h"

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"

namespace lapservo::internal::ros1_names_test {

TEST(Ros1Names, Masters) {
  EXPECT_EQ(to_string(master_address("")), "http://localhost:11311");
  EXPECT_EQ(to_string(master_address("http://dvrk-pc.local:11312/")), "http://dvrk-pc.local:11312");
  for (const char* wrong : {"localhost:11311", "https://a:1", "http://a", "http://:1", "http://a:", "http://a:0",
                            "http://a:65536", "http://a:1x", "http://a:1/b", "http://a b:1"})
    EXPECT_NE(testing::input_error([&] { master_address(wrong); }), "") << wrong;
}

TEST(Ros1Names, StandInTheirNamespace) {
  EXPECT_EQ(resolved_ros1_name("PSM1", "", "--robot"), "/PSM1");
  EXPECT_EQ(resolved_ros1_name("PSM1", "dvrk", "--robot"), "/dvrk/PSM1");
  EXPECT_EQ(resolved_ros1_name("PSM1", "/dvrk/", "--robot"), "/dvrk/PSM1");
  EXPECT_EQ(resolved_ros1_name("/PSM1/measured_js", "/dvrk", "--robot"), "/PSM1/measured_js");
  for (const char* wrong : {"", "/", "//a", "/a//b", "/a/", "/1a", "/_a", "/a b", "/a\nb", "/a-b", "~a"})
    EXPECT_NE(testing::input_error([&] { resolved_ros1_name(wrong, "", "--robot"); }), "") << wrong;
}

}  // namespace lapservo::internal::ros1_names_test
