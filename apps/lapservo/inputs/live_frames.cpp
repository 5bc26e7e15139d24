#include "apps/lapservo/inputs/live_frames.h"

#include <chrono>
#include <thread>

#include "apps/lapservo/cli/interrupt.h"

namespace lapservo::app {

LiveFrames::LiveFrames(const std::string& text, const Camera& camera)
    : LiveSource(interrupted),
      text_(text),
      transports_(live_node_name),
      images_(text, "input", camera, clock_, transports_) {}

std::optional<StampedImage> LiveFrames::take() {
  auto image = images_.newest();
  if (image) last_s_ = image->time_s;
  if (!image) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  return image;
}

std::string LiveFrames::why_none() {
  return dropped().empty() ? transports_.unpublished(text_, "input") : images_.complaint();
}

}  // namespace lapservo::app
