#pragma once

#include <optional>

#include "lapservo/io/frame_source.h"

namespace lapservo::internal {

/// A source of even images, for tests: each a level brighter than the one before.
class EvenFrames : public FrameSource {
 public:
  EvenFrames(const cv::Size& size, int count, double fps = 30) : size_(size), count_(count), fps_(fps) {}
  std::optional<Frame> next() override {
    if (shown_ == count_) return std::nullopt;
    Frame frame{cv::Mat(size_, CV_8UC3, cv::Scalar::all(10 + shown_)), shown_, shown_ / fps_, {}, {}};
    ++shown_;
    return frame;
  }
  Kind kind() const override { return Kind::video; }
  std::optional<int> frame_count() const override { return count_; }
  double frames_per_second() const override { return fps_; }

 private:
  cv::Size size_;
  int count_, shown_ = 0;
  double fps_;
};

}  // namespace lapservo::internal
