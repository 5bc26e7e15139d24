#pragma once

#include <memory>
#include <optional>
#include <string>

#include "lapservo/io/frame_source.h"
#include "recordings/bag.h"

namespace lapservo::internal {

/// The images of a bag's topic as frames, with the times of their headers' stamps. Unreadable images, and images
/// without a stamp or with one not later than the previous, are left out and reported in complaint().
class BagFrames : public FrameSource {
 public:
  /// `topic`: see image_topic_of(). Throws InputError when no image can be read.
  BagFrames(std::shared_ptr<const Bag> bag, const std::string& topic);

  std::optional<Frame> next() override;
  Kind kind() const override { return Kind::video; }
  std::optional<int> frame_count() const override;
  double frames_per_second() const override;
  std::string complaint() const override;
  const std::string& topic() const { return topic_.name; }
  std::optional<double> first_stamp_s() const override { return first_->stamp_s; }

 private:
  struct Picture {
    double stamp_s = 0;
    cv::Mat bgr;
  };
  std::optional<Picture> read();
  void leave_out(const std::string& why);

  std::shared_ptr<const Bag> bag_;
  BagTopic topic_;
  std::unique_ptr<BagMessages> messages_;
  std::optional<Picture> first_;
  double last_stamp_s_ = 0;
  int index_ = 0, left_out_ = 0;
  std::string why_;  // the first was
};

}  // namespace lapservo::internal
