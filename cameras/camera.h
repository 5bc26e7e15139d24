#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "lapservo/crtk/messages.h"

namespace lapservo::internal {

/// Where a camera's images go, in its thread, one at a time. Stamps are on the monotonic clock, NaN where there is
/// none.
struct ImageSink {
  std::function<void(ImageMessage&&)> image;
  std::function<void(CompressedImageMessage&&)> compressed;
};

/// A camera at work. Destroyed, its sink is not called any more.
class LiveCamera {
 public:
  virtual ~LiveCamera() = default;
  /// Nothing while images may come. Then why none does any more, in one line; empty when that is how it should end.
  virtual std::optional<std::string> ended() const = 0;
};

/// A Video4Linux device, for example /dev/video0, that takes images of this size: raw ones, and JPEG where that is
/// faster. Stamped by the kernel. Throws InputError, naming the device, when it can't be used or has no such size.
std::unique_ptr<LiveCamera> open_v4l2_camera(const std::string& device, int width_px, int height_px, ImageSink sink);

/// A GStreamer pipeline's text up to, without, its sink, for example "decklinkvideosrc ! deinterlace"; stamped by its
/// buffers' running times. What is not live plays at its own speed. Throws InputError, naming the pipeline, when it
/// can't be parsed or started.
std::unique_ptr<LiveCamera> open_gst_camera(const std::string& pipeline, ImageSink sink);

}  // namespace lapservo::internal
