#pragma once

#include <memory>
#include <string>

#include "lapservo/io/frame_source.h"
#include "lapservo/io/v4l2_device.h"

namespace lapservo::internal {

/// Whether a name is a camera's (a number, /dev/video0) or a stream's (rtsp://...) rather than a file's.
bool is_live(const std::string& input);

/// The frames of a camera in the size that it is set to, or of a stream by FFmpeg's libraries; their times are those at
/// which they were asked for. A stream, or a camera that gives nothing for 30 s, has ended. Throws InputError when
/// there is none.
std::unique_ptr<FrameSource> open_live_source(const std::string& input);

/// 8-bit BGR of a device's buffer; empty when it is no whole image.
cv::Mat bgr_of(const V4l2Layout& layout, std::span<const std::uint8_t> bytes);

}  // namespace lapservo::internal
