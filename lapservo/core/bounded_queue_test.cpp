#include "lapservo/core/bounded_queue.h"

#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace lapservo::internal::bounded_queue_test {

template <typename T>
std::vector<T> rest_of(BoundedQueue<T>& queue) {
  std::vector<T> rest;
  while (auto value = queue.pop()) rest.push_back(*value);
  return rest;
}

TEST(BoundedQueue, GivesWhatWaitsWhenClosedAndTakesNothingMore) {
  BoundedQueue<int> queue;
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(queue.push(i));
  queue.close();
  EXPECT_FALSE(queue.push(3));
  queue.push_over_oldest(4);
  EXPECT_EQ(rest_of(queue), (std::vector{0, 1, 2}));
}

TEST(BoundedQueue, DropsWhatWaitsWhenCancelled) {
  BoundedQueue<std::shared_ptr<int>> queue;
  const auto value = std::make_shared<int>(1);
  queue.push(value);
  queue.cancel();
  EXPECT_EQ(value.use_count(), 1);
  EXPECT_FALSE(queue.pop());
}

TEST(BoundedQueue, KeepsTheNewestWhereTheOldestGo) {
  BoundedQueue<int> queue(2);
  for (int i = 0; i < 5; ++i) queue.push_over_oldest(i);
  queue.close();
  EXPECT_EQ(rest_of(queue), (std::vector{3, 4}));
}

TEST(BoundedQueue, RefusesWhereThereIsNoRoomWithoutWaiting) {
  BoundedQueue<int> queue(2);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(queue.try_push(i), i < 2) << i;
  queue.close();
  EXPECT_EQ(rest_of(queue), (std::vector{0, 1}));
  EXPECT_FALSE(queue.try_push(5));
}

TEST(BoundedQueue, NeverHoldsMoreThanItsCapacityAndLosesNothing) {
  constexpr int values = 2000;
  BoundedQueue<int> queue(3);
  std::atomic<int> in = 0;
  std::thread from([&] {
    for (int i = 0; i < values && queue.push(i); ++i) ++in;
    queue.close();
  });
  for (int i = 0; i < values; ++i) {
    EXPECT_LE(in - i, 3);
    ASSERT_EQ(queue.pop(), i);
  }
  from.join();
  EXPECT_FALSE(queue.pop());
}

TEST(BoundedQueue, ThatClosesWakesEachThatWaits) {
  for (const auto close : {&BoundedQueue<int>::close, &BoundedQueue<int>::cancel}) {
    BoundedQueue<int> empty, full(1);
    full.push(0);
    std::vector<std::thread> waiting;
    for (int i = 0; i < 2; ++i) {
      waiting.emplace_back([&] { EXPECT_FALSE(empty.pop()); });
      waiting.emplace_back([&] { EXPECT_FALSE(full.push(1)); });
    }
    (empty.*close)();
    (full.*close)();
    for (std::thread& thread : waiting) thread.join();
  }
}

}  // namespace lapservo::internal::bounded_queue_test
