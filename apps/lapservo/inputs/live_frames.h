#pragma once

#include <optional>
#include <string>

#include "apps/lapservo/inputs/live_images.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/robot/steady_clock.h"

namespace lapservo::app {

/// A topic's images as frames to be measured: the newest each time, until none comes for 15 s or Ctrl-C.
class LiveFrames : public FrameSource {
 public:
  /// See LiveImages.
  LiveFrames(const std::string& text, const Camera& camera);

  std::optional<Frame> next() override;
  Kind kind() const override { return Kind::live; }
  std::optional<int> frame_count() const override { return std::nullopt; }
  double frames_per_second() const override { return 30; }
  std::string complaint() const override { return complaint_; }
  /// Of the frame given last, since it came.
  double age_s() const { return clock_.now_s() - last_s_; }
  /// What became of those that are no frames, in words; empty when there were none.
  std::string dropped() const { return images_.counts().text(); }

 private:
  std::string complaint_;
  SteadyClock clock_;
  Transports transports_;
  LiveImages images_;
  std::optional<double> first_s_;
  double last_s_ = 0;
  int index_ = 0;
};

}  // namespace lapservo::app
