#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "lapservo/io/frame_source.h"

namespace lapservo::internal {

/// A source as another one is, but for what is overridden.
class FrameFilter : public FrameSource {
 public:
  explicit FrameFilter(std::unique_ptr<FrameSource> source) : source_(std::move(source)) {}

  std::optional<Frame> next() override { return source_->next(); }
  Kind kind() const override { return source_->kind(); }
  std::optional<int> frame_count() const override { return source_->frame_count(); }
  double frames_per_second() const override { return source_->frames_per_second(); }
  std::optional<double> first_stamp_s() const override { return source_->first_stamp_s(); }
  std::string remark() const override { return source_->remark(); }
  bool is_srgb() const override { return source_->is_srgb(); }
  bool is_lossy() const override { return source_->is_lossy(); }
  std::string complaint() const override { return source_->complaint(); }

 private:
  std::unique_ptr<FrameSource> source_;
};

}  // namespace lapservo::internal
