#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "lapservo/io/frame_source.h"

namespace lapservo::internal {

/// Said where a colour matrix or a place of chroma is given for a source that has no use for it.
inline constexpr auto ignored_colours_text =
    "--colour-matrix and --chroma-location are ignored: they are for videos in YCbCr";

/// The frames of a video file or, live, of a stream (rtsp://...), by FFmpeg's libraries: OpenCV hides what their
/// decoders complain of. Damaged are those that the decoder complained of, or that were predicted from such a one; in
/// place of a frame that can't be decoded at all comes the one before (or black). Times are those of the container's
/// stamps since its first frame, be that damaged; where it has none, they go by the rate.
///
/// Throws InputError when it holds no video that can be decoded, one of coarse_pixels(), or one with an orientation for
/// display: a calibration belongs to the pixels in one orientation, and it is unknown which. `patience` bounds the time
/// of opening, not that of reading; a stream that falls silent is waited for as long, and has ended then.
std::unique_ptr<FrameSource> open_video(const std::string& name, FrameSource::Kind kind,
                                        const VideoReading& reading = {},
                                        std::chrono::milliseconds patience = std::chrono::seconds(5));

}  // namespace lapservo::internal
