#include "lapservo/crtk/image_receiver.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "lapservo/crtk/image_decoder.h"

namespace lapservo::internal {
std::string ImageCounts::text() const {
  std::string text;
  const auto add = [&](const char* what, long count) {
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", what, count);
  };
  add("skipped", skipped);
  add("missing", missing);
  add("repeated", repeated);
  add("late", late);
  add("after a jump of the clock", jumped);
  add("without a stamp", unstamped);
  add("of another size", resized);
  add("unreadable", unreadable);
  add("of another sender", other_senders);
  return text;
}

void ImageReceiver::receive(Message&& message, double arrival_s) {
  const auto [source, stamp_s] =
      std::visit([](const auto& one) { return std::pair(one.source, one.stamp_s); }, message);
  const std::lock_guard lock(mutex_);
  if (!is_of_first_sender(source, arrival_s))
    return refuse(&ImageCounts::other_senders, "two programs publish this camera's images");
  const StampClock::Reading measured = clock_.read(stamp_s, arrival_s);
  if (measured.verdict == StampVerdict::jumped) last_stamp_s_.reset();
  struct Refusal {
    long ImageCounts::*count;
    const char* why;
  };
  static const std::map<StampVerdict, Refusal> refusals{
      {StampVerdict::repeated, {&ImageCounts::repeated, "the same stamp again"}},
      {StampVerdict::late, {&ImageCounts::late, "late"}},
      {StampVerdict::jumped, {&ImageCounts::jumped, "the camera's clock jumped"}},
      {StampVerdict::unusable, {&ImageCounts::unstamped, "no stamp"}}};
  if (const auto refused = refusals.find(measured.verdict); refused != refusals.end())
    return refuse(refused->second.count, refused->second.why);
  count_gap(stamp_s);
  if (waiting_) ++counts_.skipped;
  const double time_s = stamps_by_ == StampsBy::loop ? std::min(stamp_s, arrival_s) : measured.time_s;
  waiting_ = Waiting{time_s, std::move(message)};
}

bool ImageReceiver::is_of_first_sender(std::uint64_t source, double arrival_s) {
  const bool had_rival = sender_.has_rival(arrival_s);
  const FirstSender::Verdict verdict = sender_.hear(source, arrival_s);
  if (verdict == FirstSender::Verdict::counts_anew) last_stamp_s_.reset();
  if (verdict == FirstSender::Verdict::counts_anew || (!had_rival && sender_.has_rival(arrival_s)))
    second_sender_ = true;
  return verdict != FirstSender::Verdict::other;
}

bool ImageReceiver::take_second_sender() {
  const std::lock_guard lock(mutex_);
  return std::exchange(second_sender_, false);
}

// The usual distance follows the shortest ones seen.
void ImageReceiver::count_gap(double stamp_s) {
  constexpr double follow = 0.01;
  if (last_stamp_s_) {
    const double gap_s = stamp_s - *last_stamp_s_;
    if (distance_s_ && gap_s > 1.5 * *distance_s_ && gap_s < 60)
      counts_.missing += std::lround(gap_s / *distance_s_) - 1;
    distance_s_ = distance_s_ ? std::min(gap_s, *distance_s_ + follow * (gap_s - *distance_s_)) : gap_s;
  }
  last_stamp_s_ = stamp_s;
}

void ImageReceiver::refuse(long ImageCounts::*count, const std::string& why) {
  ++(counts_.*count);
  complaint_ = why;
}

std::optional<StampedImage> ImageReceiver::newest() {
  std::optional<Waiting> waiting;
  {
    const std::lock_guard lock(mutex_);
    waiting = std::exchange(waiting_, std::nullopt);
  }
  if (!waiting) return std::nullopt;
  DecodedImage decoded = std::visit([](auto& message) { return decode(std::move(message)); }, waiting->message);
  const std::lock_guard lock(mutex_);
  if (const auto* bad = std::get_if<BadImage>(&decoded)) {
    refuse(&ImageCounts::unreadable, bad->why);
    return std::nullopt;
  }
  cv::Mat& bgr = std::get<cv::Mat>(decoded);
  if (bgr.size() != size_) {
    refuse(&ImageCounts::resized,
           fmt::format("size {}x{}, expected {}x{} as in the rig", bgr.cols, bgr.rows, size_.width, size_.height));
    return std::nullopt;
  }
  ++counts_.taken;
  return StampedImage{waiting->time_s, std::move(bgr)};
}

ImageCounts ImageReceiver::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

std::string ImageReceiver::complaint() const {
  const std::lock_guard lock(mutex_);
  return complaint_;
}

}  // namespace lapservo::internal
