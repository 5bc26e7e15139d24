#include "lapservo/io/video/yuv_colors.h"

#include <algorithm>
#include <array>
#include <string_view>

extern "C" {
#include <libavutil/pixdesc.h>
}

#include "lapservo/io/video/bgr_converter.h"

namespace lapservo::internal {
namespace {

std::optional<YuvMatrix> matrix_of(AVColorSpace tag) {
  switch (tag) {
    case AVCOL_SPC_UNSPECIFIED:
    case AVCOL_SPC_RESERVED:
    case AVCOL_SPC_RGB:  // some cameras' streams say so of YUV
    case AVCOL_SPC_BT470BG:
    case AVCOL_SPC_SMPTE170M:
      return YuvMatrix::bt601;
    case AVCOL_SPC_BT709:
      return YuvMatrix::bt709;
    case AVCOL_SPC_FCC:
      return YuvMatrix::fcc;
    case AVCOL_SPC_SMPTE240M:
      return YuvMatrix::smpte240m;
    case AVCOL_SPC_BT2020_NCL:
      return YuvMatrix::bt2020;
    default:
      return std::nullopt;
  }
}

ChromaSite usual_site(AVCodecID codec, AVColorSpace matrix) {
  switch (codec) {
    case AV_CODEC_ID_MJPEG:
    case AV_CODEC_ID_WEBP:
    case AV_CODEC_ID_THEORA:
    case AV_CODEC_ID_MPEG1VIDEO:
    case AV_CODEC_ID_H261:
    case AV_CODEC_ID_H263:
    case AV_CODEC_ID_H263I:
    case AV_CODEC_ID_H263P:
    case AV_CODEC_ID_FLV1:
    case AV_CODEC_ID_MSMPEG4V1:
    case AV_CODEC_ID_MSMPEG4V2:
    case AV_CODEC_ID_MSMPEG4V3:
    case AV_CODEC_ID_WMV1:
    case AV_CODEC_ID_WMV2:
      return ChromaSite::centre;
    default:
      return matrix == AVCOL_SPC_BT2020_NCL ? ChromaSite::top_left : ChromaSite::left;
  }
}

// Decoders of H.264, H.265 and MPEG-4 say left where the stream says nothing.
ChromaSite site_of(const AVFrame& frame, AVCodecID codec, bool from_rgb) {
  switch (frame.chroma_location) {
    case AVCHROMA_LOC_CENTER:
      return ChromaSite::centre;
    case AVCHROMA_LOC_TOPLEFT:
      return ChromaSite::top_left;
    case AVCHROMA_LOC_TOP:
      return ChromaSite::top;
    case AVCHROMA_LOC_BOTTOMLEFT:
      return ChromaSite::bottom_left;
    case AVCHROMA_LOC_BOTTOM:
      return ChromaSite::bottom;
    case AVCHROMA_LOC_LEFT:
      return from_rgb ? ChromaSite::centre : ChromaSite::left;
    default:
      return from_rgb ? ChromaSite::centre : usual_site(codec, frame.colorspace);
  }
}

}  // namespace

bool names_software_encoder(std::span<const std::uint8_t> bytes) {
  using namespace std::string_view_literals;
  constexpr std::array names{"x264 - core"sv, "x265 (build"sv, "Lavc"sv};
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return std::any_of(names.begin(), names.end(),
                     [&](std::string_view name) { return text.find(name) != std::string_view::npos; });
}

std::optional<YuvColors> yuv_colors_of(const AVFrame& frame, AVCodecID codec, bool from_rgb) {
  const AVPixelFormat format = pixel_format_of(frame);
  const AVPixFmtDescriptor* const description = av_pix_fmt_desc_get(format);
  if (description && (description->flags & AV_PIX_FMT_FLAG_RGB) != 0) return YuvColors();
  const auto matrix = matrix_of(frame.colorspace);
  if (!matrix) return std::nullopt;
  const bool full_range = format != frame.format || frame.color_range == AVCOL_RANGE_JPEG;
  return YuvColors{*matrix, full_range, site_of(frame, codec, from_rgb && frame.colorspace == AVCOL_SPC_UNSPECIFIED)};
}

}  // namespace lapservo::internal
