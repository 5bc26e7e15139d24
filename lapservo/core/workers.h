#pragma once

#include <cstddef>
#include <functional>
#include <future>
#include <memory>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include "lapservo/core/bounded_queue.h"

namespace lapservo::internal {

/// Runs tasks in threads of its own, begun in the order of their arrival, or without threads, in the order in which
/// results are requested. For one caller.
class Workers {
 public:
  /// With 0 a task runs when its result is requested.
  explicit Workers(int threads) {
    for (int i = 0; i < threads; ++i) threads_.emplace_back([this, i] { work(static_cast<std::size_t>(i)); });
  }
  /// Waits for the tasks that are being done; of the others, which nobody may wait for any more, none is begun.
  ~Workers() {
    tasks_.cancel();
    for (std::thread& thread : threads_) thread.join();
  }

  /// Calls the task with the index of its thread, 0 without threads. The future has what it returns or throws.
  template <typename Task>
  std::future<std::invoke_result_t<Task, std::size_t>> run(Task task) {
    if (threads_.empty()) return std::async(std::launch::deferred, std::move(task), std::size_t{0});
    using Packaged = std::packaged_task<std::invoke_result_t<Task, std::size_t>(std::size_t)>;
    const auto packaged = std::make_shared<Packaged>(std::move(task));
    auto result = packaged->get_future();
    tasks_.push([packaged](std::size_t thread) { (*packaged)(thread); });
    return result;
  }

 private:
  void work(std::size_t thread) {
    while (const auto task = tasks_.pop()) (*task)(thread);
  }

  BoundedQueue<std::function<void(std::size_t)>> tasks_;
  std::vector<std::thread> threads_;
};

}  // namespace lapservo::internal
