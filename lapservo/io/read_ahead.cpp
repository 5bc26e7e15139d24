#include "lapservo/io/read_ahead.h"

#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

namespace lapservo::internal {
namespace {

constexpr std::size_t most_ahead = 3;

class ReadAhead : public FrameSource {
 public:
  explicit ReadAhead(std::unique_ptr<FrameSource> source)
      : source_(std::move(source)),
        kind_(source_->kind()),
        frame_count_(source_->frame_count()),
        frames_per_second_(source_->frames_per_second()),
        first_stamp_s_(source_->first_stamp_s()) {}
  ~ReadAhead() override { stop(); }
  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;

  std::optional<Frame> next() override {
    if (!thread_.joinable() && !stopped_) thread_ = std::thread([this] { read(); });
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return !frames_.empty() || ended_; });
    if (frames_.empty()) {
      if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
      return std::nullopt;
    }
    Frame frame = std::move(frames_.front());
    frames_.pop_front();
    changed_.notify_all();
    return frame;
  }
  Kind kind() const override { return kind_; }
  std::optional<int> frame_count() const override { return frame_count_; }
  double frames_per_second() const override { return frames_per_second_; }
  std::optional<double> first_stamp_s() const override { return first_stamp_s_; }
  /// Of what was read: after it, nothing more is.
  std::string complaint() const override {
    stop();
    return source_->complaint();
  }

 private:
  void read() {
    try {
      while (auto frame = source_->next()) {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return frames_.size() < most_ahead || stopped_; });
        if (stopped_) break;
        frames_.push_back(std::move(*frame));
        changed_.notify_all();
      }
    } catch (...) {
      const std::lock_guard lock(mutex_);
      failure_ = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    ended_ = true;
    changed_.notify_all();
  }
  void stop() const {
    {
      const std::lock_guard lock(mutex_);
      stopped_ = true;
      ended_ = ended_ || !thread_.joinable();
      changed_.notify_all();
    }
    if (thread_.joinable()) thread_.join();
  }

  std::unique_ptr<FrameSource> source_;  // the thread's, once it runs
  Kind kind_;
  std::optional<int> frame_count_;
  double frames_per_second_;
  std::optional<double> first_stamp_s_;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  std::deque<Frame> frames_;
  std::exception_ptr failure_;
  mutable bool ended_ = false, stopped_ = false;
  mutable std::thread thread_;
};

}  // namespace

std::unique_ptr<FrameSource> read_ahead(std::unique_ptr<FrameSource> source) {
  return std::make_unique<ReadAhead>(std::move(source));
}

}  // namespace lapservo::internal
