#include "lapservo/core/workers.h"

#include <atomic>
#include <cstddef>
#include <future>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace lapservo::internal::workers_test {

class Workers0And1 : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Threads, Workers0And1, ::testing::Values(0, 1));

TEST_P(Workers0And1, DoesTasksInTheOrderTheyCame) {
  std::vector<int> done;  // one at a time, so it needs no lock
  Workers worker(GetParam());
  std::vector<std::future<int>> results;
  for (int i = 0; i < 200; ++i)
    results.push_back(worker.run([&done, i](std::size_t) { return done.push_back(i), i * i; }));
  for (int i = 0; i < 200; ++i) EXPECT_EQ(results[static_cast<std::size_t>(i)].get(), i * i);
  for (int i = 0; i < 200; ++i) EXPECT_EQ(done[static_cast<std::size_t>(i)], i);
}

TEST_P(Workers0And1, TellsWhatATaskThrewAndGoesOn) {
  Workers worker(GetParam());
  auto broken = worker.run([](std::size_t) -> int { throw std::runtime_error("broken"); });
  auto whole = worker.run([](std::size_t) { return 3; });
  EXPECT_THROW(broken.get(), std::runtime_error);
  EXPECT_EQ(whole.get(), 3);
}

// Done or given up, nobody waits for ever.
TEST(Workers, ThatGoesLeavesNobodyWaiting) {
  std::vector<std::future<void>> results;
  std::atomic<int> begun = 0;
  {
    Workers worker(1);
    for (int i = 0; i < 50; ++i) results.push_back(worker.run([&begun](std::size_t) { ++begun; }));
  }
  int done = 0;
  for (auto& result : results) {
    try {
      result.get(), ++done;
    } catch (const std::future_error& given_up) {
      EXPECT_EQ(given_up.code(), std::future_errc::broken_promise);
    }
  }
  EXPECT_EQ(done, begun);
}

}  // namespace lapservo::internal::workers_test
