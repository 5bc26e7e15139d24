#pragma once

#include <functional>
#include <future>
#include <memory>
#include <thread>
#include <type_traits>
#include <utility>

#include "lapservo/core/bounded_queue.h"

namespace lapservo::internal {

/// Runs tasks one after the other in a thread of its own, in the order of their arrival, or without a thread, in the
/// order in which results are requested. For one caller.
class SerialWorker {
 public:
  enum class Thread { none, own };
  /// Without a thread a task runs when its result is requested.
  explicit SerialWorker(Thread thread) {
    if (thread == Thread::own) thread_ = std::thread([this] { work(); });
  }
  /// Waits for the task that is being done; of the others, which nobody may wait for any more, none is begun.
  ~SerialWorker() {
    tasks_.cancel();
    if (thread_.joinable()) thread_.join();
  }
  SerialWorker(const SerialWorker&) = delete;
  SerialWorker& operator=(const SerialWorker&) = delete;

  /// The future has what the task returns or throws.
  template <typename Task>
  std::future<std::invoke_result_t<Task>> run(Task task) {
    if (!thread_.joinable()) return std::async(std::launch::deferred, std::move(task));
    const auto packaged = std::make_shared<std::packaged_task<std::invoke_result_t<Task>()>>(std::move(task));
    auto result = packaged->get_future();
    tasks_.push([packaged] { (*packaged)(); });
    return result;
  }

 private:
  void work() {
    while (const auto task = tasks_.pop()) (*task)();
  }

  BoundedQueue<std::function<void()>> tasks_;
  std::thread thread_;
};

}  // namespace lapservo::internal
