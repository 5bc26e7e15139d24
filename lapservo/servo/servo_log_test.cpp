#include "lapservo/servo/servo_log.h"

#include <array>
#include <atomic>
#include <cmath>
#include <fcntl.h>
#include <optional>
#include <string>
#include <sys/stat.h>
#include <thread>
#include <tuple>
#include <unistd.h>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::servo_log_test {

constexpr std::uint64_t seed = 5;

Eigen::Vector4d any(Random& random) {
  return {random.normal(), 1e-7 * random.normal(), 1e5 * random.normal(), random.uniform()};
}

struct Record {
  ServoInput input;
  ServoDecision decision;
  std::optional<InstrumentTruth> truth;
};

Record any_record(Random& random, int kind) {
  Record record;
  record.input.time_s = random.uniform(0, 100);
  record.input.joints = {record.input.time_s, JointVector::from_vector(any(random)),
                         kind % 2 ? OperatingState::enabled : OperatingState::fault, kind % 3 != 0, kind % 5 == 0};
  record.input.desired = {any(random), any(random), any(random), kind % 2 ? HoldReason::tip_open : HoldReason::none};
  for (int i = 0; i < kind % 4; ++i)
    record.input.readings.push_back({random.uniform(), JointVector::from_vector(any(random))});
  if (kind % 3) {
    ImageMeasurement image;
    image.found = kind % 3 == 1;
    image.time_s = random.uniform();
    image.registration = kind % 4;
    image.repetition = static_cast<Repetition>(kind % 3);
    if (kind % 4 == 3) {
      const Eigen::Vector4d position = any(random);
      image.camera_from_marker = Rigid3{Eigen::Quaterniond(any(random)), position.head<3>()};
      image.features = any(random), image.covariance.setZero(), image.ends_px = any(random);
    }
    if (image.found) {
      image.features = any(random);
      const Eigen::Matrix4d root = any(random) * any(random).transpose();
      image.covariance = root * root.transpose();
      image.covariance = (image.covariance + image.covariance.transpose()).eval();
      image.ends_px = any(random);
      if (kind % 2) image.q = any(random);
    }
    record.input.image = image;
  }
  record.decision.control.velocity = any(random);
  record.decision.registration = kind % 5;
  if (kind % 5 == 2) record.decision.camera_from_rcm = Rigid3{};
  if (kind % 2) record.truth = InstrumentTruth{any(random), {}};
  return record;
}

void expect_same_bits(const ServoInput& a, const ServoInput& b) {
  const auto joints = [](const ServoInput& i) {
    return std::tuple(i.time_s, i.joints.q.vector(), i.joints.operating_state, i.joints.follows, i.joints.started);
  };
  EXPECT_EQ(joints(a), joints(b));
  const auto reading = [](const JointReading& r) { return std::tuple(r.time_s, r.q.vector()); };
  ASSERT_EQ(a.readings.size(), b.readings.size());
  for (std::size_t i = 0; i < a.readings.size(); ++i) EXPECT_EQ(reading(a.readings[i]), reading(b.readings[i]));
  const auto goal = [](const DesiredFeatures& d) { return std::tuple(d.features, d.rate, d.acceleration, d.hold); };
  EXPECT_EQ(goal(a.desired), goal(b.desired));
  ASSERT_EQ(a.image.has_value(), b.image.has_value());
  if (!a.image) return;
  const auto frame = [](const ImageMeasurement& i) {
    return std::tuple(i.found, i.time_s, i.registration, i.repetition, i.camera_from_marker);
  };
  EXPECT_EQ(frame(*a.image), frame(*b.image));
  if (!a.image->found && !a.image->camera_from_marker) return;
  const auto numbers = [](const ImageMeasurement& i) { return std::tuple(i.features, i.covariance, i.ends_px, i.q); };
  EXPECT_EQ(numbers(*a.image), numbers(*b.image));
}

TEST(ServoLog, ReadsBackToTheLastBit) {
  const testing::TemporaryFolder folder;
  Random random(seed);
  std::vector<Record> records;
  ServoLog log(folder / "log.csv");
  for (int i = 0; i < 60; ++i) {
    records.push_back(any_record(random, i));
    log.add(records.back().input, records.back().decision, records.back().truth);
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "log.csv"));
  log.commit();
  const auto ticks = read_servo_log(folder / "log.csv");
  ASSERT_EQ(ticks.size(), records.size());
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    SCOPED_TRACE(i);
    expect_same_bits(records[i].input, ticks[i].input);
    EXPECT_EQ(ticks[i].decision, decision_fields(records[i].decision));
  }
}

TEST(ServoLog, KeepsWhatIsNotANumber) {
  const testing::TemporaryFolder folder;
  Record record;
  record.decision.control.reason = HoldReason::non_finite;
  record.input.joints.q = {NAN, INFINITY, 0, -0.0};
  ServoLog log(folder / "log.csv");
  log.add(record.input, record.decision, record.truth);
  log.commit();
  const Eigen::Vector4d q = read_servo_log(folder / "log.csv")[0].input.joints.q.vector();
  EXPECT_TRUE(std::isnan(q[0]));
  EXPECT_EQ(q[1], double{INFINITY});
  EXPECT_TRUE(std::signbit(q[3]));
}

// A pipe that nobody reads stands for a disk that hangs.
TEST(ServoLog, NeverWaitsForTheDisk) {
  const testing::TemporaryFolder folder;
  const std::string path = folder / "log.csv";
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  const int pipe = open(path.c_str(), O_RDWR | O_NONBLOCK);
  ASSERT_GE(pipe, 0);
  std::optional<ServoLog> log(path);
  const std::string complaint = testing::input_error([&] {
    constexpr int enough = 100'000;
    for (int i = 0; i < enough; ++i) log->add({}, {}, {});
  });
  EXPECT_NE(complaint.find("too slow"), std::string::npos) << complaint;
  std::thread ending([&] { log.reset(); });
  std::atomic<bool> ended = false;
  std::thread reading([&] {
    std::array<char, 65536> bytes{};
    while (!ended)
      if (read(pipe, bytes.data(), bytes.size()) < 0) std::this_thread::yield();
  });
  ending.join();
  ended = true;
  reading.join();
  close(pipe);
}

TEST(ServoLog, NamesWhatIsWrong) {
  const testing::TemporaryFolder folder;
  Random random(seed);
  ServoLog log(folder / "log.csv");
  const Record record = any_record(random, 1);
  log.add(record.input, record.decision, record.truth);
  log.commit();
  const std::string good = testing::read_file(folder / "log.csv");
  const auto complaint = [&](const std::string& from, const std::string& to) {
    std::string bad = good;
    bad.replace(bad.find(from), from.size(), to);
    testing::write_file(folder / "bad.csv", bad);
    return testing::input_error([&] { read_servo_log(folder / "bad.csv"); });
  };
  EXPECT_NE(complaint("ENABLED", "SLEEPY").find("arm_state"), std::string::npos);
  EXPECT_NE(complaint(",found,", ",maybe,").find("none, lost, marker or found"), std::string::npos);
  EXPECT_NE(complaint("joint_theta_rad", "joint_kappa_rad").find("joint_theta_rad"), std::string::npos);
  EXPECT_FALSE(testing::input_error([&] { read_servo_log(folder / "none.csv"); }).empty());
}

}  // namespace lapservo::internal::servo_log_test
