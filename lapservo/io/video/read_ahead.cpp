#include "lapservo/io/video/read_ahead.h"

#include <exception>
#include <thread>
#include <utility>

#include "lapservo/core/bounded_queue.h"

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
        first_stamp_s_(source_->first_stamp_s()),
        remark_(source_->remark()),
        is_srgb_(source_->is_srgb()),
        is_lossy_(source_->is_lossy()) {}
  ~ReadAhead() override { stop(); }

  std::optional<Frame> next() override {
    if (!thread_.joinable() && !stopped_) thread_ = std::thread([this] { read(); });
    auto frame = frames_.pop();
    if (!frame && failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
    return frame;
  }
  Kind kind() const override { return kind_; }
  std::optional<int> frame_count() const override { return frame_count_; }
  double frames_per_second() const override { return frames_per_second_; }
  std::optional<double> first_stamp_s() const override { return first_stamp_s_; }
  std::string remark() const override { return remark_; }
  bool is_srgb() const override { return is_srgb_; }
  bool is_lossy() const override { return is_lossy_; }
  /// The end of the source: no frame follows it.
  std::string complaint() const override {
    stop();
    return source_->complaint();
  }

 private:
  void read() {
    try {
      while (auto frame = source_->next())
        if (!frames_.push(std::move(*frame))) break;
    } catch (...) {
      failure_ = std::current_exception();
    }
    frames_.close();
  }
  void stop() const {
    stopped_ = true;
    frames_.close();
    if (thread_.joinable()) thread_.join();
  }

  std::unique_ptr<FrameSource> source_;  // the thread's, once it runs
  Kind kind_;
  std::optional<int> frame_count_;
  double frames_per_second_;
  std::optional<double> first_stamp_s_;
  std::string remark_;
  bool is_srgb_, is_lossy_;
  mutable BoundedQueue<Frame> frames_{most_ahead};
  std::exception_ptr failure_;  // the thread's, until frames_ is closed
  mutable bool stopped_ = false;
  mutable std::thread thread_;
};

}  // namespace

std::unique_ptr<FrameSource> read_ahead(std::unique_ptr<FrameSource> source) {
  return std::make_unique<ReadAhead>(std::move(source));
}

}  // namespace lapservo::internal
