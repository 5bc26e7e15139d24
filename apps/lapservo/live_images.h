#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "cameras/camera.h"
#include "lapservo/crtk/image_receiver.h"
#include "lapservo/crtk/transport.h"
#include "lapservo/geometry/camera.h"
#include "lapservo/robot/clock.h"

namespace lapservo::app {

/// Each transport once, however many ask for it.
class Transports {
 public:
  explicit Transports(std::string node_name) : node_name_(std::move(node_name)) {}
  /// Throws as make_transport().
  internal::Transport& get(const std::string& transport, const std::string& option);

 private:
  std::string node_name_;
  std::map<std::string, std::unique_ptr<internal::Transport>> transports_;
};

/// Whether a text names images that come by themselves: ros2:/topic, ros1:/topic, gst:PIPELINE, /dev/videoN.
bool names_live_images(const std::string& text);

/// A camera of this computer: /dev/videoN, which must have this size, or gst:PIPELINE. Throws InputError, naming
/// `option`, for what is none of them or can't be opened.
std::unique_ptr<internal::LiveCamera> open_local_camera(const std::string& text, const std::string& option,
                                                        const cv::Size& size, internal::ImageSink sink);

/// Those images, received; see internal::ImageReceiver.
class LiveImages : public ImageStream {
 public:
  /// `camera`: the rig's, whose size images must have. Throws InputError, naming `option`, for what is none of them or
  /// can't be opened. The transports and the clock must outlive it.
  LiveImages(const std::string& text, const std::string& option, const Camera& camera, const Clock& clock,
             Transports& transports);

  std::optional<StampedImage> newest() override { return receiver_.newest(); }
  internal::ImageCounts counts() const { return receiver_.counts(); }
  std::string complaint() const { return receiver_.complaint(); }
  /// See internal::LiveCamera; topics never end.
  std::optional<std::string> ended() const { return camera_ ? camera_->ended() : std::nullopt; }

 private:
  void subscribe(internal::Transport& transport, const std::string& topic);
  internal::ImageSink sink();

  const Clock& clock_;
  internal::ImageReceiver receiver_;
  internal::Transport::Subscription subscription_;  // these last: they use the others
  std::unique_ptr<internal::LiveCamera> camera_;
};

}  // namespace lapservo::app
