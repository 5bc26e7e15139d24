#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <limits>
#include <mutex>
#include <optional>
#include <utility>

namespace lapservo::internal {

/// Values from any threads to any threads, in the order in which they were put in; at most `capacity` of them wait.
template <typename T>
class BoundedQueue {
 public:
  explicit BoundedQueue(std::size_t capacity = std::numeric_limits<std::size_t>::max()) : capacity_(capacity) {}

  /// Waits for room. False, and the value is dropped, once the queue is closed.
  bool push(T value) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return closed_ || values_.size() < capacity_; });
    if (closed_) return false;
    values_.push_back(std::move(value));
    changed_.notify_all();
    return true;
  }

  /// Does not wait. False, and the value is dropped, where there is no room or the queue is closed.
  bool try_push(T value) {
    const std::lock_guard lock(mutex_);
    if (closed_ || values_.size() >= capacity_) return false;
    values_.push_back(std::move(value));
    changed_.notify_all();
    return true;
  }

  /// Does not wait: where there is no room the oldest values are dropped. With capacity 1 the newest is kept.
  void push_over_oldest(T value) {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    if (values_.size() >= capacity_) values_.pop_front();
    values_.push_back(std::move(value));
    changed_.notify_all();
  }

  /// The oldest value, for which it waits. Nullopt once the queue is closed and empty.
  std::optional<T> pop() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return closed_ || !values_.empty(); });
    if (values_.empty()) return std::nullopt;
    std::optional<T> value(std::move(values_.front()));
    values_.pop_front();
    changed_.notify_all();
    return value;
  }

  /// Takes nothing more in; what waits can be taken out.
  void close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    changed_.notify_all();
  }

  bool closed() const {
    const std::lock_guard lock(mutex_);
    return closed_;
  }

  /// Closes the queue, and drops what waits.
  void cancel() {
    std::deque<T> dropped;
    const std::lock_guard lock(mutex_);
    closed_ = true;
    values_.swap(dropped);
    changed_.notify_all();
  }

 private:
  std::size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<T> values_;
  bool closed_ = false;
};

}  // namespace lapservo::internal
