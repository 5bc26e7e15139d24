#pragma once

#include <functional>
#include <optional>
#include <string>

#include "lapservo/io/frame_source.h"
#include "lapservo/robot/steady_clock.h"
#include "lapservo/stream/image_stream.h"

namespace lapservo::internal {

/// Frames of what is live: until it ends, none comes for 15 s, or `stop` returns true.
class LiveSource : public FrameSource {
 public:
  explicit LiveSource(std::function<bool()> stop) : stop_(std::move(stop)) {}

  std::optional<Frame> next() override;
  Kind kind() const override { return Kind::live; }
  std::optional<int> frame_count() const override { return std::nullopt; }
  double frames_per_second() const override { return 30; }
  std::string complaint() const override { return complaint_; }

 protected:
  /// The next image; waits for it for some milliseconds at most.
  virtual std::optional<StampedImage> take() = 0;
  /// See LiveCamera.
  virtual std::optional<std::string> ended() const = 0;
  /// Why no image came, in words; empty where that is unknown.
  virtual std::string why_none() { return {}; }

  SteadyClock clock_;

 private:
  std::function<bool()> stop_;
  std::string complaint_;
  std::optional<double> first_s_;
  int index_ = 0;
};

}  // namespace lapservo::internal
