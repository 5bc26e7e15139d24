#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include <opencv2/core.hpp>

#include "lapservo/crtk/messages.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/stream/image_stream.h"

namespace lapservo::internal {

/// Whether a text names a camera of this computer: gst:PIPELINE, /dev/videoN, or N where no file has that name.
bool names_camera(const std::string& text);

/// The GStreamer pipeline of such a camera, without its sink: PIPELINE itself, or one that reads the Video4Linux device
/// in this size, in that which GStreamer chooses where `size` is empty: raw, but JPEG where raw is slower than 25
/// frames/s.
std::string camera_pipeline(const std::string& camera, const cv::Size& size);

/// A camera at work. Destroyed, its sink is not called any more.
class LiveCamera {
 public:
  virtual ~LiveCamera() = default;
  /// Nothing while images may come. Then why none does any more, in one line; empty when that is how it should end.
  virtual std::optional<std::string> ended() const = 0;
  /// The next image, where the camera was opened without a sink; nothing when none comes within that time.
  /// Its time is the stamp of open_camera()'s images.
  virtual std::optional<StampedImage> take(std::chrono::milliseconds patience) = 0;
  /// As the camera announces it, else 30.
  virtual double frames_per_second() const = 0;
};

/// Where a camera's images go, in its thread, one at a time.
using CameraSink = std::function<void(ImageMessage&&)>;

/// The camera at work on camera_pipeline(). Images are bgr8 by the colorimetry of the pipeline's caps, and stamped on
/// the monotonic clock by their buffers' running times, NaN where there is none. Without a sink two images wait to be
/// taken; newer images of a live camera replace them. Other sources play at their own speed. Throws InputError, naming
/// the camera and the remedy, when it gives no image within 10 s, or when this build lacks GStreamer.
std::unique_ptr<LiveCamera> open_camera(const std::string& camera, const cv::Size& size, CameraSink sink = nullptr);

/// The frames of a camera, which end with it, when none comes for 15 s, or when `stop` returns true; of what names no
/// camera open_frame_source(). Throws as that and open_camera().
std::unique_ptr<FrameSource> open_camera_or_file(const std::string& input, double folder_fps, const cv::Size& size = {},
                                                 std::function<bool()> stop = nullptr,
                                                 const VideoReading& reading = {});

}  // namespace lapservo::internal
