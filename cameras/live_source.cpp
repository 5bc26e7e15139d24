#include "cameras/live_source.h"

#include <utility>

namespace lapservo::internal {

std::optional<Frame> LiveSource::next() {
  constexpr double patience_s = 15;
  for (const double begin_s = clock_.now_s(); !stop_ || !stop_();) {
    const auto end = ended();  // before the last image, which may have come since
    if (auto image = take()) {
      if (!first_s_) first_s_ = image->time_s;
      return Frame{std::move(image->bgr), index_++, image->time_s - *first_s_, {}, {}};
    }
    if (end) {
      complaint_ = *end;
      return std::nullopt;
    }
    if (clock_.now_s() > begin_s + patience_s) {
      const std::string why = why_none();
      complaint_ = "no image came within 15 s" + (why.empty() ? "" : " (" + why + ")");
      return std::nullopt;
    }
  }
  return std::nullopt;
}

}  // namespace lapservo::internal
