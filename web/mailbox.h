#pragma once

#include <atomic>
#include <memory>
#include <utility>

namespace lapservo::internal {

/// Holds the newest of what was put in. Neither who puts nor who takes ever waits for the other.
template <typename T>
class Mailbox {
 public:
  Mailbox() = default;
  ~Mailbox() { take(); }
  Mailbox(const Mailbox&) = delete;
  Mailbox& operator=(const Mailbox&) = delete;

  void put(T value) {
    const auto before = exchange(std::make_unique<T>(std::move(value)));  // and ends here
  }
  /// Nullptr where nothing came since the last call.
  std::unique_ptr<T> take() { return exchange(nullptr); }

 private:
  std::unique_ptr<T> exchange(std::unique_ptr<T> value) {
    return std::unique_ptr<T>(newest_.exchange(value.release()));
  }

  std::atomic<T*> newest_ = nullptr;
};

}  // namespace lapservo::internal
