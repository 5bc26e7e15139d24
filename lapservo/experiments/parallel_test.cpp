#include <atomic>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/experiments/setup.h"

namespace lapservo::internal::parallel_test {

const KeepGoing always = [](int, int) { return true; };

TEST(InParallel, DoesEveryIndexOnceAndCountsUp) {
  for (const int count : {0, 1, 2, 500}) {
    std::vector<std::atomic<int>> times(static_cast<std::size_t>(count));
    int last = 0;
    in_parallel(
        count, [&] { return [&](int index) { ++times[static_cast<std::size_t>(index)]; }; },
        [&](int done, int total) {
          EXPECT_EQ(done, ++last);
          EXPECT_EQ(total, count);
          return true;
        });
    EXPECT_EQ(last, count);
    for (const auto& n : times) EXPECT_EQ(n, 1);
  }
}

TEST(InParallel, StopsWhenAsked) {
  std::atomic<int> begun = 0;
  EXPECT_THROW(in_parallel(
                   100000, [&] { return [&](int) { ++begun; }; }, [](int done, int) { return done < 10; }),
               Interrupted);
  EXPECT_GE(begun, 10);
  EXPECT_LT(begun, 1000);
}

TEST(InParallel, PassesAnErrorOn) {
  const auto failing = [] {
    return [](int index) {
      if (index == 7) throw std::runtime_error("seven");
    };
  };
  EXPECT_THROW(in_parallel(50, failing, always), std::runtime_error);
  const auto no_worker = []() -> std::function<void(int)> { throw std::logic_error("none"); };
  EXPECT_THROW(in_parallel(5, no_worker, always), std::logic_error);
}

}  // namespace lapservo::internal::parallel_test
