// An arm on Fast DDS, ROS 2's default, in a process of its own.

#include <chrono>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/testing/process.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/testing/wait_for.h"
#include "transports/ros2/ros2_transport.h"

namespace lapservo::internal::fastdds_test {
using testing::wait_for;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds tick(2);

class Arm {
 public:
  explicit Arm(std::string output) : output_(std::move(output)), process_(LAPSERVO_FASTDDS_PEER, {}, output_) {}

  // The positions of the setpoints that came.
  std::vector<double> heard() const {
    std::vector<double> all;
    std::istringstream lines(testing::read_file(output_));
    for (std::string line; std::getline(lines, line);)
      if (double position = 0; std::istringstream(line) >> position) all.push_back(position);
    return all;
  }
  // How many writers of setpoints it knows.
  bool says(const std::string& words) const { return testing::read_file(output_).find(words) != std::string::npos; }

 private:
  std::string output_;
  testing::Process process_;
};

TEST(FastDds, AnArmThatIsRestartedIsFoundWithinTwoSecondsAndGetsNoOldSetPoint) {
  const testing::TemporaryFolder folder;
  Ros2Transport loop("loop");
  const auto publish = loop.set_point_publisher("/PSM1/servo_jp");
  const auto say = [&](double position) {
    publish({loop.stamp_now_s(), {}, {position}});
    std::this_thread::sleep_for(tick);
  };
  {
    const Arm arm((folder / "first.txt").string());
    ASSERT_TRUE(wait_for([&] { return say(1), !arm.heard().empty(); }));
  }
  for (int k = 0; k < 20; ++k) say(2);
  {
    const Arm held((folder / "held.txt").string());  // while the loop sends nothing
    ASSERT_TRUE(wait_for([&] { return held.says("writers 1"); }));
    std::this_thread::sleep_for(std::chrono::seconds(1));
    EXPECT_TRUE(held.heard().empty());
  }
  const auto restarted = Clock::now();
  const Arm arm((folder / "restarted.txt").string());
  ASSERT_TRUE(wait_for([&] { return say(3), !arm.heard().empty(); }));
  EXPECT_LT(Clock::now() - restarted, std::chrono::seconds(2));
  for (const double position : arm.heard()) EXPECT_EQ(position, 3);
  EXPECT_EQ(loop.readers("/PSM1/servo_jp").size(), 1u) << "those that were killed are still there";
}

TEST(FastDds, ALoopThatEndsIsMissedAtOnce) {
  const testing::TemporaryFolder folder;
  const Arm arm((folder / "arm.txt").string());
  {
    Ros2Transport loop("loop");
    const auto publish = loop.set_point_publisher("/PSM1/servo_jp");
    ASSERT_TRUE(wait_for([&] { return arm.says("writers 1"); }));
  }
  std::this_thread::sleep_for(std::chrono::seconds(1));
  EXPECT_TRUE(arm.says("writers 0"));
}

}  // namespace lapservo::internal::fastdds_test
