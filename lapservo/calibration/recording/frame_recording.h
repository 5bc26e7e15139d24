#pragma once

#include <functional>
#include <optional>
#include <string>

#include <opencv2/core.hpp>

#include "lapservo/io/frame_source.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// Frames from which something of a rig is measured.
struct FrameRecording {
  FrameSource& source;
  std::string name;          ///< for complaints: a path
  bool deinterlace = false;  ///< the field of the even rows, whatever the rig says
};

/// Interface of a job of seconds to minutes with its caller; either may be empty.
struct JobWatch {
  std::function<bool()> is_stopped;
  /// Total, where known; done; a remark.
  std::function<void(std::optional<int>, int, const std::string&)> progress;

  bool stopped() const { return is_stopped && is_stopped(); }
  void tell(std::optional<int> total, int done, const std::string& remark) const {
    if (progress) progress(total, done, remark);
  }
};

/// A number of the rig that was measured, in the unit that its name ends in; sigma: one standard deviation.
struct CalibratedNumber {
  std::string name;
  double before, after, sigma;
};

/// How many of so many frames are damaged, and the remedy.
std::string text_of_damaged(int damaged, int frames);

/// Counts of a recording's frames.
struct FramesRead {
  int looked_at = 0;
  int damaged = 0;        ///< see Frame::flaw
  int jpegs = 0;          ///< of those looked at: what compressed them saw no frame before
  bool stopped = false;   ///< by the user, before its end; a camera has none
  bool lossy = false;     ///< FrameSource::is_lossy(), or JPEG
  std::string complaint;  ///< what could not be read; empty when all was, and when it was stopped

  bool all_damaged() const { return damaged > 0 && looked_at == 0; }
  /// " (3 are damaged)", or nothing.
  std::string remark_on_damaged() const;
};

/// Throws InputError, naming `recording`, where that says how it encodes light, which is undone, and the rig's response
/// is neither sRGB nor measured with images that were read so.
void expect_srgb(bool is_srgb, const std::string& recording, const Response& response);

/// Throws InputError, naming the frame's file or else `recording`, at a frame of another size than `whose`.
void check_frame_size(const Frame& frame, const std::string& recording, const cv::Size& expected,
                      const std::string& whose);

/// Throws InputError, naming the frame's file or else `recording`, at a frame that was read otherwise than it is
/// tracked: as expect_srgb(), and at a video's that was not opened for `deinterlace`, which needs each field's own
/// chroma.
void check_frame_reading(const Frame& frame, const std::string& recording, const Response& response, bool deinterlace);

/// Shows every `every`-th frame to `look`, as the tracker would see it, with its time; `look` may keep it, and returns
/// a remark beside the progress. Throws InputError at a frame that is not of the rig's size, as check_frame_reading(),
/// and where all are damaged.
FramesRead read_frames(const FrameRecording& recording, const Rig& rig, int every, const JobWatch& watch,
                       const std::function<std::string(const cv::Mat&, double)>& look);

/// Which frames to look at so that of a long recording about so many are.
int every_of(const FrameSource& source, int enough);

}  // namespace lapservo::internal
