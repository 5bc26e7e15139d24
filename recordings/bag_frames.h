#pragma once

#include <memory>
#include <optional>
#include <string>

#include "lapservo/io/frame_source.h"
#include "recordings/bag.h"
#include "recordings/stamped_messages.h"

namespace lapservo::internal {

/// The images of a bag's topic as frames, with the times of their headers' stamps (stamped_messages.h). Unreadable
/// images, and those that are left out for their stamps, are reported in complaint().
class BagFrames : public FrameSource {
 public:
  /// `topic`: see image_topic_of(). Throws InputError when no image can be read.
  BagFrames(std::shared_ptr<const Bag> bag, const std::string& topic);

  std::optional<Frame> next() override;
  Kind kind() const override { return Kind::video; }
  std::optional<int> frame_count() const override;
  double frames_per_second() const override;
  std::string remark() const override { return bag_->remark(); }
  /// By JPEG.
  bool is_lossy() const override { return is_jpeg_; }
  std::string complaint() const override;
  const std::string& topic() const { return topic_.name; }
  std::optional<double> first_stamp_s() const override { return first_->time_s; }

 private:
  struct Picture {
    double time_s = 0;
    cv::Mat bgr;
  };
  std::optional<Picture> read();
  const std::string& why() const;

  std::shared_ptr<const Bag> bag_;
  BagTopic topic_;
  StampedMessages messages_;
  std::optional<Picture> first_;
  int index_ = 0, unreadable_ = 0;
  bool is_jpeg_ = false;        // the first was
  std::string why_unreadable_;  // the first was
};

}  // namespace lapservo::internal
