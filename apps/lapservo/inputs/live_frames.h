#pragma once

#include <optional>
#include <string>

#include "apps/lapservo/inputs/live_images.h"
#include "cameras/live_source.h"

namespace lapservo::app {

/// The node's name, in all of the command that reads them.
constexpr auto live_node_name = "lapservo_track";

/// A topic's images as frames to be measured: the newest each time, until Ctrl-C.
class LiveFrames : public internal::LiveSource {
 public:
  /// See LiveImages.
  LiveFrames(const std::string& text, const Camera& camera);

  /// Age of the last frame, since its arrival.
  double age_s() const { return clock_.now_s() - last_s_; }
  /// Counts of unusable images, in words; empty when there were none.
  std::string dropped() const { return images_.counts().text(); }

 protected:
  std::optional<StampedImage> take() override;
  std::optional<std::string> ended() const override { return images_.ended(); }
  std::string why_none() override;

 private:
  std::string text_;
  Transports transports_;
  LiveImages images_;
  double last_s_ = 0;
};

}  // namespace lapservo::app
