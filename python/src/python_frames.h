#pragma once
#include <memory>
#include <optional>
#include <string>

#include "lapservo/geometry/camera.h"
#include "lapservo/io/frame_source.h"
#include "python/src/conversions.h"

namespace lapservo::python {

/// The frames of an image, a folder, a video, a bag or a camera, which threads may share; next() and complaint() wait
/// without Python's lock. `image_topic`: of a bag with several. Throws
/// InputError as internal::open_camera_or_file() and internal::BagFrames, and for `fps` beyond 0.001 to 1000.
std::unique_ptr<FrameSource> open_path(const std::string& path, double fps, const VideoReading& reading = {},
                                       const std::string& image_topic = {});

/// A str or what os.PathLike is.
bool is_path(const py::object& given);

/// Frames that Python gives, by one of: a path (an image, a folder, a video, a camera), a FrameSource, or anything
/// that is iterated over: uint8[H, W, 3], (time_s, uint8[H, W, 3]) or Frame. Created and destroyed with Python's lock,
/// used without.
struct GivenFrames {
  /// `fps` gives times to the images of a folder and to those without; `camera`, or null, and `deinterlace` say how a
  /// path is read; what its FrameSource::remark() says is a warning. Throws InputError as
  /// internal::open_camera_or_file() and internal::expect_srgb(). Refuses an iterated frame whose time is not finite
  /// or, `of_one_recording`, does not rise.
  GivenFrames(const py::object& given, double fps, const Camera* camera, bool deinterlace,
              bool of_one_recording = true);

  py::object kept;  ///< what `source` is of
  std::unique_ptr<FrameSource> owned;
  FrameSource* source = nullptr;
  std::string name;  ///< for complaints: the path, or "frames"
};

}  // namespace lapservo::python
