#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/crtk/transport.h"

namespace lapservo::internal {

/// Messages that arrived, for a waiting test.
template <typename Message>
class TestInbox {
 public:
  Transport::Handler<Message> handler() {
    return [this](Message&& message) {
      const std::lock_guard lock(mutex_);
      messages_.push_back(std::move(message));
      changed_.notify_all();
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
    std::unique_lock lock(mutex_);
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (messages_.empty() && std::chrono::steady_clock::now() < end) {
      lock.unlock();
      say();
      lock.lock();
      changed_.wait_for(lock, std::chrono::milliseconds(20), [this] { return !messages_.empty(); });
    }
    EXPECT_FALSE(messages_.empty());
    return messages_.empty() ? Message{} : messages_.front();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Message> messages_;
};

}  // namespace lapservo::internal
