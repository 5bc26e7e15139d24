#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include <opencv2/core.hpp>

#include "lapservo/vision/observation.h"

namespace lapservo {

struct Frame {
  cv::Mat bgr;                 ///< 8-bit
  int index = 0;               ///< from 0
  double time_s = 0;           ///< since the first frame
  std::filesystem::path file;  ///< the image's path; empty for videos and cameras
  std::optional<Status> flaw;  ///< why nothing is to be measured in it
  /// Of a video or a stream: VideoReading::deinterlaced.
  std::optional<bool> deinterlaced = {};
  bool is_srgb = false;  ///< FrameSource::is_srgb()
};

/// Frames of an image, a folder of images (in the order of the numbers in their names), a video file, a stream
/// ("rtsp://...") or a camera.
class FrameSource {
 public:
  enum class Kind { image, folder, video, live };

  virtual ~FrameSource() = default;
  /// nullopt at the end. Throws InputError for an image that can't be read, or that names another encoding of light
  /// than the folder's first one.
  virtual std::optional<Frame> next() = 0;
  virtual Kind kind() const = 0;
  /// Where it is known beforehand.
  virtual std::optional<int> frame_count() const = 0;
  virtual double frames_per_second() const = 0;
  /// The origin of `time_s` on the clock that stamps a recording's other messages, where there are such.
  virtual std::optional<double> first_stamp_s() const { return std::nullopt; }
  /// How it is read where the file does not say, in words, and the option that decides; empty where it says.
  virtual std::string remark() const { return {}; }
  /// Whether its values are light in sRGB by what the file names (HLG, PQ, linear), whatever the camera's response.
  virtual bool is_srgb() const { return false; }
  /// Whether its frames went through a codec that loses some of them, as videos' do: edges of colours lie aside then.
  virtual bool is_lossy() const { return false; }
  /// After the end: what is wrong with the file as a whole, for example that it ends early; empty when nothing is.
  virtual std::string complaint() const { return {}; }
};

/// How videos and streams are read.
struct VideoReading {
  bool deinterlaced = false;      ///< one field of each frame is tracked: chroma of 4:2:0 is read for each by itself
  std::string colour_matrix{};    ///< bt601, bt709 or bt2020, whatever the video names; empty: by the video
  std::string chroma_location{};  ///< left, centre or top-left, whatever the video names; empty: by the video
};

/// All but cameras. `folder_fps` gives the images of a folder their times. Throws InputError when there is nothing to
/// read: a missing or empty file, a folder without images, with an image that is a link to no file or with two images
/// of one name, a video without frames, a stream that doesn't answer; and for words in `reading` that have no meaning.
std::unique_ptr<FrameSource> open_frame_source(const std::string& input, double folder_fps,
                                               const VideoReading& reading = {});

}  // namespace lapservo
