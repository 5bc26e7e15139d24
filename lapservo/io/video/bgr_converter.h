#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/io/video/libav.h"
#include "lapservo/io/video/yuv_picture.h"

namespace lapservo::internal {

/// AVFrame::format without the deprecated formats that say full range (yuvj420p ...).
AVPixelFormat pixel_format_of(const AVFrame& frame);

/// coarse_pixels() of picture_parts.h of a frame that this codec decoded.
std::string coarse_pixels(const AVFrame& frame, AVCodecID codec);

/// Makes 8-bit BGR of frames, by swscale. Chroma that has fewer samples than luma is interpolated from where these lie:
/// samples that are repeated instead shift colour boundaries by up to half a pixel.
class BgrConverter {
 public:
  /// `colours`: of frames that hold RGB only the transfer. `by_field`: the rows are two fields', and chroma that has
  /// fewer rows (4:2:0) belongs to each by itself. False for pixels that swscale can't read.
  bool convert(const AVFrame& frame, const YuvColours& colours, bool by_field, cv::Mat& bgr);

 private:
  struct Source {
    int width_px = 0, height_px = 0;
    AVPixelFormat format = AV_PIX_FMT_NONE;
    YuvColours colours;
    bool by_field = false;
    bool operator==(const Source&) const = default;
  };
  bool set_up(const Source& source);

  std::optional<Source> source_;        // what the scalers read
  std::vector<libav::Scaler> scalers_;  // of the whole frame, or of its two fields
  std::array<cv::Mat, 3> planes_;       // green, blue and red of sources with chroma
};

}  // namespace lapservo::internal
