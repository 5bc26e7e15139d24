#include "recordings/bag_frames.h"

#include <algorithm>
#include <utility>
#include <variant>

#include <climits>
#include <fmt/format.h>

#include "lapservo/core/error.h"
#include "lapservo/crtk/image_decoder.h"
#include "lapservo/io/image_file.h"
#include "recordings/bag_topics.h"

namespace lapservo::internal {
namespace {

struct StampedDecoded {
  double stamp_s = 0;
  DecodedImage image = BadImage{"no message of its type; message by message compressed bags want `ros2 bag convert`"};
};

StampedDecoded decoded(const BagMessage& message) {
  if (const auto* raw = std::get_if<ImageMessage>(&message)) return {raw->stamp_s, decode(*raw)};
  if (const auto* jpeg = std::get_if<CompressedImageMessage>(&message)) return {jpeg->stamp_s, decode(*jpeg)};
  return {};
}

}  // namespace

BagFrames::BagFrames(std::shared_ptr<const Bag> bag, const std::string& topic)
    : bag_(std::move(bag)), topic_(image_topic_of(*bag_, topic)), messages_(bag_->messages(topic_)) {
  first_ = read();
  if (!first_)
    throw InputError(bag_->path(), fmt::format("{}: none of {} images can be read: {}", topic_.name, left_out_, why_));
}

void BagFrames::leave_out(const std::string& why) {
  if (left_out_++ == 0) why_ = why;
}

std::optional<BagFrames::Picture> BagFrames::read() {
  while (const auto message = messages_->next()) {
    StampedDecoded found = decoded(*message);
    if (const auto* bad = std::get_if<BadImage>(&found.image)) {
      leave_out(bad->why);
    } else if (!(found.stamp_s > 0)) {
      leave_out("no stamp");
    } else if (!(found.stamp_s > last_stamp_s_)) {
      leave_out("its stamp is not later than the one before");
    } else {
      last_stamp_s_ = found.stamp_s;
      return Picture{found.stamp_s, std::move(std::get<cv::Mat>(found.image))};
    }
  }
  return std::nullopt;
}

std::optional<Frame> BagFrames::next() {
  auto picture = index_ == 0 ? std::optional(Picture{first_->stamp_s, std::exchange(first_->bgr, {})}) : read();
  if (!picture) return std::nullopt;
  Frame frame{std::move(picture->bgr), index_++, picture->stamp_s - first_->stamp_s, {}, {}};
  if (has_few_colours(frame.bgr)) frame.flaw = Status::few_colours;
  return frame;
}

std::optional<int> BagFrames::frame_count() const {
  return static_cast<int>(std::min<std::uint64_t>(topic_.messages, INT_MAX));
}

double BagFrames::frames_per_second() const {
  constexpr double usual = 30;
  if (topic_.messages < 2 || !(topic_.duration_s > 0)) return usual;
  return std::clamp(static_cast<double>(topic_.messages - 1) / topic_.duration_s, 0.1, 1000.0);
}

std::string BagFrames::complaint() const {
  if (left_out_ == 0) return {};
  return fmt::format("{}: {} of {} images are left out ({})", topic_.name, left_out_, left_out_ + index_, why_);
}

}  // namespace lapservo::internal
