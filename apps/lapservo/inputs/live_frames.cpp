#include "apps/lapservo/inputs/live_frames.h"

#include <chrono>
#include <thread>

#include "apps/lapservo/cli/interrupt.h"

namespace lapservo::app {
using namespace internal;

LiveFrames::LiveFrames(const std::string& text, const Camera& camera)
    : transports_("lapservo_track"), images_(text, "input", camera, clock_, transports_) {}

std::optional<Frame> LiveFrames::next() {
  constexpr double patience_s = 15;
  for (const double begin_s = clock_.now_s(); !interrupted();) {
    const auto ended = images_.ended();  // before the last image, which may have come since
    if (auto image = images_.newest()) {
      if (!first_s_) first_s_ = image->time_s;
      last_s_ = image->time_s;
      return Frame{std::move(image->bgr), index_++, image->time_s - *first_s_, {}, {}};
    }
    if (ended) {
      complaint_ = *ended;
      return std::nullopt;
    }
    if (clock_.now_s() > begin_s + patience_s) {
      complaint_ = "no image came within 15 s" + (dropped().empty() ? "" : " (" + images_.complaint() + ")");
      return std::nullopt;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return std::nullopt;
}

}  // namespace lapservo::app
