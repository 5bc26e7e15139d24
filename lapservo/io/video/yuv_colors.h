#pragma once

#include <optional>

#include "lapservo/io/video/libav.h"

namespace lapservo::internal {

/// How a decoded frame's luma and chroma become red, green and blue.
struct YuvColors {
  int matrix = SWS_CS_ITU601;  ///< SWS_CS_...
  bool full_range = false;     ///< 0 to 255 and not 16 to 235
  bool operator==(const YuvColors&) const = default;
};

/// By the frame's tags (AVFrame::colorspace, color_range), which decoders take from the stream. Without a tag Rec.
/// 601's matrix in the limited range, which is what FFmpeg makes of RGB unless told otherwise. Nullopt for a matrix
/// that swscale does not know.
std::optional<YuvColors> yuv_colors_of(const AVFrame& frame);

/// AVFrame::format without the deprecated formats that say full range (yuvj420p ...): yuv_colors_of() has it.
AVPixelFormat pixel_format_of(const AVFrame& frame);

/// Makes `scaler`, which converts such frames to RGB, read them by `colors`. Not for frames that hold RGB.
void set_colors(SwsContext& scaler, const YuvColors& colors);

}  // namespace lapservo::internal
