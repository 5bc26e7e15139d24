#include "lapservo/io/half_frames.h"

#include <utility>

#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {

class HalfFrames : public FrameSource {
 public:
  HalfFrames(std::unique_ptr<FrameSource> source, Half half, std::string name)
      : source_(std::move(source)), half_(half), name_(std::move(name)) {}

  std::optional<Frame> next() override {
    auto frame = source_->next();
    if (!frame || frame->bgr.empty()) return frame;
    if (frame->bgr.cols % 2 != 0)
      throw InputError(name_, "has frames of " + std::to_string(frame->bgr.cols) +
                                  " columns, expected an even number: two eyes side by side");
    const int width = frame->bgr.cols / 2;
    frame->bgr = frame->bgr.colRange(half_ == Half::left ? 0 : width, half_ == Half::left ? width : 2 * width).clone();
    return frame;
  }
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
  Half half_;
  std::string name_;
};

}  // namespace

std::unique_ptr<FrameSource> half_frames(std::unique_ptr<FrameSource> source, Half half, const std::string& name) {
  return std::make_unique<HalfFrames>(std::move(source), half, name);
}

}  // namespace lapservo::internal
