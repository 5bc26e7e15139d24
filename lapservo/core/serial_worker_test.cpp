#include "lapservo/core/serial_worker.h"

#include <atomic>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace lapservo::internal {
namespace serial_worker_test {

class EachSerialWorker : public ::testing::TestWithParam<SerialWorker::Thread> {};
INSTANTIATE_TEST_SUITE_P(Threads, EachSerialWorker,
                         ::testing::Values(SerialWorker::Thread::none, SerialWorker::Thread::own));

TEST_P(EachSerialWorker, DoesTasksInTheOrderTheyCame) {
  std::vector<int> done;  // one at a time, so it needs no lock
  SerialWorker worker(GetParam());
  std::vector<std::future<int>> results;
  for (int i = 0; i < 200; ++i) results.push_back(worker.run([&done, i] { return done.push_back(i), i * i; }));
  for (int i = 0; i < 200; ++i) EXPECT_EQ(results[static_cast<std::size_t>(i)].get(), i * i);
  for (int i = 0; i < 200; ++i) EXPECT_EQ(done[static_cast<std::size_t>(i)], i);
}

TEST_P(EachSerialWorker, TellsWhatATaskThrewAndGoesOn) {
  SerialWorker worker(GetParam());
  auto broken = worker.run([]() -> int { throw std::runtime_error("broken"); });
  auto whole = worker.run([] { return 3; });
  EXPECT_THROW(broken.get(), std::runtime_error);
  EXPECT_EQ(whole.get(), 3);
}

// Done or given up, nobody waits for ever.
TEST(SerialWorker, ThatGoesLeavesNobodyWaiting) {
  std::vector<std::future<void>> results;
  std::atomic<int> begun = 0;
  {
    SerialWorker worker(SerialWorker::Thread::own);
    for (int i = 0; i < 50; ++i) results.push_back(worker.run([&begun] { ++begun; }));
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

}  // namespace serial_worker_test
}  // namespace lapservo::internal
