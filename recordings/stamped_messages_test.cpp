#include "recordings/stamped_messages.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::stamped_messages_test {

struct Recorded {
  double stamp_s = 0, recorded_s = 0;
};

class ListedMessages : public BagMessages {
 public:
  explicit ListedMessages(std::vector<Recorded> all) : all_(std::move(all)) {}
  std::optional<BagMessage> next() override {
    if (next_ == all_.size()) return std::nullopt;
    return JointMessage{all_[next_++].stamp_s, {}, {}};
  }
  double recorded_s() const override { return all_[next_ - 1].recorded_s; }

 private:
  std::vector<Recorded> all_;
  std::size_t next_ = 0;
};

struct Read {
  std::vector<double> times_s;
  int left_out = 0, repeated = 0, steps = 0, steps_by_gap = 0;
};

Read read(const std::vector<Recorded>& all) {
  StampedMessages messages(std::make_unique<ListedMessages>(all));
  std::vector<double> times_s;
  while (const auto message = messages.next()) times_s.push_back(message->time_s);
  return {times_s, messages.left_out(), messages.repeated(), messages.steps(), messages.steps_by_gap()};
}

constexpr double begin_s = 1.7e9, period_s = 0.04, late_s = 0.02;
constexpr std::size_t count = 60;

// Stamps 25 times a second, recorded up to 20 ms later.
std::vector<Recorded> usual() {
  Random random(3);
  std::vector<Recorded> all;
  for (std::size_t i = 0; i < count; ++i) {
    const double stamp_s = begin_s + period_s * static_cast<double>(i);
    all.push_back({stamp_s, stamp_s + 0.01 + random.uniform(0, late_s)});
  }
  return all;
}

void expect_rises(const Read& read) {
  for (std::size_t i = 1; i < read.times_s.size(); ++i) EXPECT_GT(read.times_s[i], read.times_s[i - 1]) << i;
}

TEST(StampedMessages, ThoseWhoseStampsStandOutAreLeftOut) {
  for (const double by_s : {3600.0, -3600.0, 1.0, -1.0, 1e9})
    for (const std::size_t at : {std::size_t{0}, std::size_t{1}, std::size_t{30}, count - 1}) {
      auto all = usual();
      all[at].stamp_s += by_s;
      const Read result = read(all);
      EXPECT_EQ(result.times_s.size(), count - 1) << by_s << " s at " << at;
      EXPECT_EQ(result.steps, 0);
      for (const double time_s : result.times_s)
        EXPECT_LE(std::abs(time_s - begin_s), period_s * count) << by_s << " s at " << at;
    }
  auto all = usual();
  for (const std::size_t at : {10U, 11U, 40U}) all[at].stamp_s += 3600;
  EXPECT_EQ(read(all).times_s.size(), count - 3);
}

// Some recorders have one time for all, and messages may be seconds apart.
TEST(StampedMessages, ThoseWhoseStampsStandOutAreFoundWithoutTheRecorder) {
  for (const double apart_s : {0.01, 0.5, 4.0}) {
    std::vector<Recorded> all;
    for (int i = 0; i < 12; ++i) all.push_back({begin_s + apart_s * i, 50});
    EXPECT_EQ(read(all).times_s.size(), 12U) << apart_s;
    all[5].stamp_s += 3600;
    EXPECT_EQ(read(all).times_s.size(), 11U) << apart_s;
  }
}

TEST(StampedMessages, GoOnByTheRecorderOrTheUsualGapWhereTheClockWasSet) {
  for (const auto& [by_s, recorder_by_s] :
       {std::pair{-3600.0, 0.0}, {-0.3, 0.0}, {3600.0, 0.0}, {60.0, 0.0}, {-3600.0, -3600.0}, {-0.3, -0.3}})
    for (const std::size_t at : {std::size_t{6}, std::size_t{30}}) {
      auto all = usual();
      const auto expected = all;
      for (std::size_t i = at; i < count; ++i) all[i].stamp_s += by_s, all[i].recorded_s += recorder_by_s;
      const Read result = read(all);
      ASSERT_EQ(result.times_s.size(), count) << by_s << " s at " << at;
      EXPECT_EQ(result.steps, 1);
      EXPECT_EQ(result.steps_by_gap, recorder_by_s < 0);
      for (std::size_t i = 0; i < count; ++i) EXPECT_NEAR(result.times_s[i], expected[i].stamp_s, late_s) << by_s;
      expect_rises(result);
    }
}

// All is well; networks and cameras: late messages, stamps that repeat, a recorder that was busy, a camera that paused.
TEST(StampedMessages, AreNoStepsWhereOnlyTheirWayWasSlow) {
  auto late = usual();
  std::swap(late[20].stamp_s, late[22].stamp_s);
  expect_rises(read(late));
  EXPECT_GE(read(late).times_s.size(), count - 2);
  EXPECT_EQ(read(late).steps, 0);

  for (const std::size_t times : {2U, 10U}) {
    auto repeated = usual();
    for (std::size_t i = 0; i < count; ++i) repeated[i].stamp_s = repeated[i - i % times].stamp_s;
    const Read result = read(repeated);
    EXPECT_EQ(result.times_s.size(), count / times);
    EXPECT_EQ(result.repeated, static_cast<int>(count - count / times));
    EXPECT_EQ(result.steps, 0);
  }

  auto busy = usual(), paused = usual();
  for (std::size_t i = 20; i < count; ++i) {
    busy[i].recorded_s = std::max(busy[i].recorded_s, busy[20].recorded_s + 3 + 1e-3 * static_cast<double>(i - 20));
    paused[i].stamp_s += 30, paused[i].recorded_s += 30;
  }
  for (const auto& all : {usual(), busy, paused}) {
    const Read result = read(all);
    ASSERT_EQ(result.times_s.size(), count);
    for (std::size_t i = 0; i < count; ++i) EXPECT_EQ(result.times_s[i], all[i].stamp_s);
    EXPECT_EQ(result.left_out + result.steps, 0);
  }
}

}  // namespace lapservo::internal::stamped_messages_test
