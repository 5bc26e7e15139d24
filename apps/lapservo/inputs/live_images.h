#pragma once

#include <functional>
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
  /// For a topic (ros2:/image_raw), or that one of an arm (ros2:PSM1): empty where it has a publisher, else that it has
  /// none, and the existing topics with their types. Throws as get().
  std::string unpublished(const std::string& text, const std::string& option, const std::string& of_arm = "");

 private:
  std::string node_name_;
  std::map<std::string, std::unique_ptr<internal::Transport>> transports_;
};

/// Whether a text names a topic, ros2:/topic or ros1:/topic, whose stamps are the sender's.
bool names_topic(const std::string& text);
/// The topic of the images of --camera in a recording: that itself, or one for cameras of this computer.
std::string recorded_topic(const std::string& camera);

/// Where images go, in another thread, one at a time.
struct ImageSink {
  std::function<void(internal::ImageMessage&&)> image;
  std::function<void(internal::CompressedImageMessage&&)> compressed;
};

/// Where such images come from, until it is destroyed.
struct ImageInput {
  internal::Transport::Subscription subscription;
  std::unique_ptr<internal::LiveCamera> camera;

  /// See internal::LiveCamera; topics never end.
  std::optional<std::string> ended() const { return camera ? camera->ended() : std::nullopt; }
};
/// The images of a topic or a camera, into the sink; for `size` see internal::camera_pipeline(). Throws InputError for
/// what is neither (naming `option`) or can't be opened. The transports must outlive it.
ImageInput open_images(const std::string& text, const std::string& option, const cv::Size& size, Transports& transports,
                       ImageSink sink);

/// Those images, received; see internal::ImageReceiver.
class LiveImages : public ImageStream {
 public:
  /// `camera`: the rig's, whose size images must have. Throws as open_images(). The transports and the clock must
  /// outlive it.
  LiveImages(const std::string& text, const std::string& option, const Camera& camera, const Clock& clock,
             Transports& transports);

  std::optional<StampedImage> newest() override { return receiver_.newest(); }
  internal::ImageCounts counts() const { return receiver_.counts(); }
  std::string complaint() const { return receiver_.complaint(); }
  std::optional<std::string> ended() const { return input_.ended(); }
  bool take_second_sender() override { return receiver_.take_second_sender(); }

 private:
  const Clock& clock_;
  internal::ImageReceiver receiver_;
  ImageInput input_;  // last: it uses the others
};

}  // namespace lapservo::app
