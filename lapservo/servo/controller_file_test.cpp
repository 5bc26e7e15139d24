#include "lapservo/servo/controller_file.h"

#include <fstream>
#include <string>
#include <tuple>

#include <gtest/gtest.h>

#include "lapservo/control/tracking_law.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::controller_file_test {

ControllerConfig unusual() {
  ControllerConfig config;
  config.mode = ControlMode::paper;
  config.period_s = 1.0 / 47;
  config.gains.per_s = {1.0 / 3, 0.1, 0.2, 0.7};
  config.observer.delay_s = 0.123456789012345678;
  config.limits.lower = {-0.1, 0.9, 0.04, -3.3};
  config.limits.acceleration = {1, 1.1, 0.3, 7};
  config.window = ImageWindow{1.5, 700.25, 3, 1.0 / 7 + 400};
  return config;
}

class File {
 public:
  explicit File(const std::string& text) { std::ofstream(path()) << text; }
  std::filesystem::path path() const { return folder_ / "controller.yaml"; }
  std::string complaint() const {
    return testing::input_error([&] { load_controller(path(), {}); });
  }

 private:
  testing::TemporaryFolder folder_;
};

TEST(ControllerFile, ReadsBackToTheLastBit) {
  const ControllerConfig config = unusual(), read = load_controller(File(controller_yaml(config)).path(), {});
  const auto fields = [](const ControllerConfig& c) {
    return std::tuple(c.mode, c.period_s, c.gains.per_s, c.observer.delay_s, c.limits.lower, c.limits.upper,
                      c.limits.rate, c.limits.acceleration);
  };
  EXPECT_EQ(fields(read), fields(config));
  ASSERT_TRUE(read.window);
  EXPECT_EQ(read.window->u_max_px, config.window->u_max_px);
  EXPECT_EQ(read.window->v_max_px, config.window->v_max_px);
}

TEST(ControllerFile, WhatIsMissingStays) {
  const ControllerConfig read = load_controller(File("delay_s: estimate\n").path(), unusual());
  EXPECT_FALSE(read.observer.delay_s);
  EXPECT_EQ(read.gains.per_s, unusual().gains.per_s);
  EXPECT_EQ(read.mode, ControlMode::paper);
}

TEST(ControllerFile, GainsThatNobodyGaveAreThoseOfModeAndPeriod) {
  const ControllerConfig base = paper_controller(1.0 / 60);
  EXPECT_EQ(load_controller(File("period_s: 0.01\n").path(), base).gains.per_s, paper_gains(0.01).per_s);
  EXPECT_EQ(load_controller(File("mode: fused\n").path(), base).gains.per_s, TrackingGains().per_s);
}

TEST(ControllerFile, AFileOnlyNarrowsTheArmsLimits) {
  JointLimits of_arm;
  of_arm.lower[0] = -0.5, of_arm.rate[2] = 0.02;
  const File file("limits: {lower: [-0.8, 0.7, 0.03, -4], acceleration: [1, 2, 0.2, 7.5]}\n");
  const JointLimits both = controller_for_arm({}, file.path(), of_arm).limits;
  EXPECT_EQ(both.lower, Eigen::Vector4d(-0.5, 0.7, 0.03, -4));
  EXPECT_EQ(both.rate, of_arm.rate);
  EXPECT_EQ(both.acceleration, Eigen::Vector4d(1, 2, 0.2, 7.5));
  EXPECT_EQ(controller_for_arm({}, {}, of_arm).limits.lower, of_arm.lower);
  EXPECT_EQ(controller_for_arm({}, file.path(), {}).limits.lower[0], -0.8);
}

TEST(ControllerFile, NamesFileFieldValueAndExpectation) {
  for (const auto& [text, expected] : {std::pair<std::string, const char*>{"gain: 3\n", "gains_per_s is the nearest"},
                                       {"gains_per_s: [1, 2, 3]\n", "gains_per_s"},
                                       {"gains_per_s: [1, 2, 3, x]\n", "gains_per_s[3]"},
                                       {"gains_per_s: [1, 2, 3, .nan]\n", "gains_per_s[3]"},
                                       {"mode: fast\n", "default, paper or uncalibrated"},
                                       {"limits: {rates: [1, 1, 1, 1]}\n", "limits.rates"},
                                       {"limits: 4\n", "limits"},
                                       {"window: {u_min_px: wide}\n", "window.u_min_px"},
                                       {"period_s: [1]\n", "period_s"},
                                       {"- 1\n", "controller"},
                                       {std::string(2 << 20, ' '), "is larger than 1 MiB, expected a YAML file"}}) {
    const File file(text);
    const std::string complaint = file.complaint();
    EXPECT_TRUE(complaint.starts_with(file.path().string())) << complaint;
    EXPECT_NE(complaint.find(expected), std::string::npos) << expected << " in: " << complaint;
    EXPECT_EQ(complaint.find('\n'), std::string::npos) << complaint;
  }
}

}  // namespace lapservo::internal::controller_file_test
