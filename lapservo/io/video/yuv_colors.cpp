#include "lapservo/io/video/yuv_colors.h"

extern "C" {
#include <libavutil/pixdesc.h>
}

namespace lapservo::internal {
namespace {

std::optional<int> matrix_of(AVColorSpace tag) {
  switch (tag) {
    case AVCOL_SPC_UNSPECIFIED:
    case AVCOL_SPC_RESERVED:
    case AVCOL_SPC_RGB:  // some cameras' streams say so of YUV
    case AVCOL_SPC_BT470BG:
    case AVCOL_SPC_SMPTE170M:
      return SWS_CS_ITU601;
    case AVCOL_SPC_BT709:
      return SWS_CS_ITU709;
    case AVCOL_SPC_FCC:
      return SWS_CS_FCC;
    case AVCOL_SPC_SMPTE240M:
      return SWS_CS_SMPTE240M;
    case AVCOL_SPC_BT2020_NCL:
      return SWS_CS_BT2020;
    default:
      return std::nullopt;
  }
}

}  // namespace

std::optional<YuvColors> yuv_colors_of(const AVFrame& frame) {
  const auto matrix = matrix_of(frame.colorspace);
  if (!matrix) return std::nullopt;
  return YuvColors{*matrix, pixel_format_of(frame) != frame.format || frame.color_range == AVCOL_RANGE_JPEG};
}

AVPixelFormat pixel_format_of(const AVFrame& frame) {
  switch (frame.format) {
    case AV_PIX_FMT_YUVJ420P:
      return AV_PIX_FMT_YUV420P;
    case AV_PIX_FMT_YUVJ422P:
      return AV_PIX_FMT_YUV422P;
    case AV_PIX_FMT_YUVJ444P:
      return AV_PIX_FMT_YUV444P;
    case AV_PIX_FMT_YUVJ440P:
      return AV_PIX_FMT_YUV440P;
    case AV_PIX_FMT_YUVJ411P:
      return AV_PIX_FMT_YUV411P;
    default:
      return static_cast<AVPixelFormat>(frame.format);
  }
}

void set_colors(SwsContext& scaler, const YuvColors& colors) {
  constexpr int unity = 1 << 16;
  sws_setColorspaceDetails(&scaler, sws_getCoefficients(colors.matrix), colors.full_range ? 1 : 0,
                           sws_getCoefficients(SWS_CS_DEFAULT), 1, 0, unity, unity);
}

}  // namespace lapservo::internal
