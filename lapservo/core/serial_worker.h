#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <thread>
#include <type_traits>
#include <utility>

namespace lapservo::internal {

/// Does tasks one after the other in a thread of its own, in the order they came, or without one, in the order in which
/// their results are asked for. For one caller.
class SerialWorker {
 public:
  enum class Thread { none, own };
  /// Without a thread a task is done when its result is asked for.
  explicit SerialWorker(Thread thread);
  /// Waits for the task that is being done; of the others, which nobody may wait for any more, none is begun.
  ~SerialWorker();
  SerialWorker(const SerialWorker&) = delete;
  SerialWorker& operator=(const SerialWorker&) = delete;

  /// The future has what the task returns or throws.
  template <typename Task>
  std::future<std::invoke_result_t<Task>> run(Task task) {
    if (!thread_.joinable()) return std::async(std::launch::deferred, std::move(task));
    const auto packaged = std::make_shared<std::packaged_task<std::invoke_result_t<Task>()>>(std::move(task));
    auto result = packaged->get_future();
    post([packaged] { (*packaged)(); });
    return result;
  }

 private:
  void post(std::function<void()> task);
  void work();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> tasks_;
  bool closing_ = false;
  std::thread thread_;
};

}  // namespace lapservo::internal
