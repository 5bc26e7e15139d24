#pragma once

#include <chrono>
#include <functional>
#include <mutex>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/crtk/transport.h"
#include "lapservo/testing/wait_for.h"

namespace lapservo::internal {

/// Messages that arrived, for a waiting test.
template <typename Message>
class TestInbox {
 public:
  Transport::Handler<Message> handler() {
    return [this](Message&& message) {
      const std::lock_guard lock(mutex_);
      messages_.push_back(std::move(message));
    };
  }
  std::vector<Message> all() {
    const std::lock_guard lock(mutex_);
    return messages_;
  }
  std::size_t count() {
    const std::lock_guard lock(mutex_);
    return messages_.size();
  }
  bool empty() { return count() == 0; }
  void clear() {
    const std::lock_guard lock(mutex_);
    messages_.clear();
  }
  /// The first message. Says it again until it arrives: discovery takes its time.
  Message get(const std::function<void()>& say) {
    EXPECT_TRUE(testing::wait_for([&] { return !empty() || (say(), !empty()); }, std::chrono::milliseconds(20)));
    const std::lock_guard lock(mutex_);
    return messages_.empty() ? Message{} : messages_.front();
  }

 private:
  std::mutex mutex_;
  std::vector<Message> messages_;
};

}  // namespace lapservo::internal
