#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "lapservo/io/video/libav.h"
#include "lapservo/io/video/yuv_picture.h"

namespace lapservo::internal {

/// Whether the first bytes of a stream name x264, x265 or an encoder of libavcodec.
bool names_software_encoder(std::span<const std::uint8_t> bytes);

/// By the frame's tags (AVFrame::colorspace, color_range, chroma_location), which decoders take from the stream.
/// Without a matrix Rec. 601's, without a range the limited one. Without a place of chroma the format's: amid the
/// pixels (JPEG, MPEG-1, H.263 and their kin), top left (Rec. 2020), else left. `from_rgb`: a software encoder wrote
/// the stream; where that names no matrix either, swscale made it of RGB, as for OpenCV and `ffmpeg` without options,
/// and put chroma amid the pixels. Nullopt for a matrix that swscale does not know.
std::optional<YuvColors> yuv_colors_of(const AVFrame& frame, AVCodecID codec, bool from_rgb);

}  // namespace lapservo::internal
