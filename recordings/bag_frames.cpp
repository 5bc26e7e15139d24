#include "recordings/bag_frames.h"

#include <algorithm>
#include <utility>
#include <variant>

#include <climits>
#include <fmt/format.h>

#include "lapservo/calibration/recording/joint_recording.h"
#include "lapservo/core/error.h"
#include "lapservo/crtk/image_decoder.h"
#include "lapservo/io/pictures/picture_parts.h"
#include "recordings/bag_topics.h"

namespace lapservo::internal {

BagFrames::BagFrames(std::shared_ptr<const Bag> bag, const std::string& topic)
    : bag_(std::move(bag)), topic_(image_topic_of(*bag_, topic)), messages_(bag_->messages(topic_)) {
  first_ = read();
  if (!first_)
    throw InputError(bag_->path(), fmt::format("{}: none of {} images can be read: {}", topic_.name,
                                               messages_.left_out() + unreadable_, why()));
}

const std::string& BagFrames::why() const {
  return messages_.left_out() > 0 ? messages_.why() : why_unreadable_;
}

std::optional<BagFrames::Picture> BagFrames::read() {
  while (auto message = messages_.next()) {
    if (const auto* compressed = std::get_if<CompressedImageMessage>(&message->message); compressed && !first_)
      is_jpeg_ = picture_format(compressed->data) == PictureFormat::jpeg;
    auto* raw = std::get_if<ImageMessage>(&message->message);
    DecodedImage image = raw ? decode(std::move(*raw)) : decode(std::get<CompressedImageMessage>(message->message));
    if (auto* bgr = std::get_if<cv::Mat>(&image)) return Picture{message->time_s, std::move(*bgr)};
    if (unreadable_++ == 0) why_unreadable_ = std::get<BadImage>(image).why;
  }
  return std::nullopt;
}

std::optional<Frame> BagFrames::next() {
  auto picture = index_ == 0 ? std::optional(Picture{first_->time_s, std::exchange(first_->bgr, {})}) : read();
  if (!picture) return std::nullopt;
  return Frame{std::move(picture->bgr), index_++, picture->time_s - first_->time_s, {}, {}};
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
  std::string text;
  if (const int left_out = messages_.left_out() + unreadable_; left_out > 0)
    text = fmt::format("{}: {} of {} images are left out ({})", topic_.name, left_out, left_out + index_, why());
  if (messages_.steps() == 0) return text;
  return fmt::format("{}{}{}", text, text.empty() ? "" : "; ",
                     clock_set_text(topic_.name, messages_.steps(), messages_.steps_by_gap()));
}

}  // namespace lapservo::internal
