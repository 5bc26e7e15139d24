#include <limits>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/vision/decision/instrument_memory.h"

namespace lapservo::internal::frame_clock_test {

TEST(FrameClock, GoesOnByTheFramesTimes) {
  FrameClock clock;
  const double first_s = clock.next(1e9);
  EXPECT_EQ(clock.next(1e9 + 0.25) - first_s, 0.25);
  EXPECT_EQ(clock.next(1e9 + 4) - first_s, 4);
}

TEST(FrameClock, AlwaysGoesOn) {
  FrameClock clock;
  double before_s = clock.next(std::nullopt);
  constexpr double infinity = std::numeric_limits<double>::infinity();
  const std::vector<std::optional<double>> times_s{{}, 3, 3, 2, {}, infinity, 1, std::nan(""), 2};
  for (const auto& time_s : times_s) {
    const double now_s = clock.next(time_s);
    EXPECT_EQ(now_s - before_s, FrameClock::usual_period_s);
    before_s = now_s;
  }
}

}  // namespace lapservo::internal::frame_clock_test
