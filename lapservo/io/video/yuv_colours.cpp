#include "lapservo/io/video/yuv_colours.h"

#include <algorithm>
#include <array>
#include <map>
#include <string_view>

extern "C" {
#include <libavutil/pixdesc.h>
}

#include <fmt/format.h>

#include "lapservo/core/error.h"
#include "lapservo/io/video/bgr_converter.h"

namespace lapservo::internal {
namespace {

std::optional<YuvMatrix> matrix_of(AVColorSpace tag) {
  switch (tag) {
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

// Some cameras' streams say RGB of YUV.
bool names_no_matrix(const AVFrame& frame) {
  return frame.colorspace == AVCOL_SPC_UNSPECIFIED || frame.colorspace == AVCOL_SPC_RESERVED ||
         frame.colorspace == AVCOL_SPC_RGB;
}

bool is_rgb(const AVFrame& frame) {
  const AVPixFmtDescriptor* const format = av_pix_fmt_desc_get(pixel_format_of(frame));
  return format && (format->flags & AV_PIX_FMT_FLAG_RGB) != 0;
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

GivenColours given_colours(const std::string& colour_matrix, const std::string& chroma_location) {
  static const std::map<std::string, YuvMatrix> matrices{
      {"bt601", YuvMatrix::bt601}, {"bt709", YuvMatrix::bt709}, {"bt2020", YuvMatrix::bt2020}};
  static const std::map<std::string, ChromaSite> sites{
      {"left", ChromaSite::left}, {"centre", ChromaSite::centre}, {"top-left", ChromaSite::top_left}};
  GivenColours given;
  if (const auto found = matrices.find(colour_matrix); found != matrices.end()) given.matrix = found->second;
  if (const auto found = sites.find(chroma_location); found != sites.end()) given.chroma = found->second;
  if (!colour_matrix.empty() && !given.matrix)
    throw InputError("colour matrix", "is " + colour_matrix + ", expected bt601, bt709 or bt2020");
  if (!chroma_location.empty() && !given.chroma)
    throw InputError("chroma location", "is " + chroma_location + ", expected left, centre or top-left");
  return given;
}

std::optional<YuvColours> yuv_colours_of(const AVFrame& frame, AVCodecID codec, bool of_software,
                                         const GivenColours& given) {
  if (is_rgb(frame)) return YuvColours();
  const bool from_rgb = of_software && names_no_matrix(frame);
  YuvColours colours;
  if (given.matrix) {
    colours.matrix = *given.matrix;
  } else if (names_no_matrix(frame)) {
    colours.matrix = from_rgb ? YuvMatrix::bt601 : usual_matrix(frame.height);
  } else if (const auto matrix = matrix_of(frame.colorspace)) {
    colours.matrix = *matrix;
  } else {
    return std::nullopt;
  }
  colours.full_range = pixel_format_of(frame) != frame.format || frame.color_range == AVCOL_RANGE_JPEG;
  colours.chroma = given.chroma.value_or(site_of(frame, codec, from_rgb));
  return colours;
}

std::string remark_on_matrix(const AVFrame& frame, bool of_software) {
  const AVPixFmtDescriptor* const format = av_pix_fmt_desc_get(pixel_format_of(frame));
  const bool has_chroma = format && !is_rgb(frame) && format->nb_components >= 3;
  if (!has_chroma || !names_no_matrix(frame) || usual_matrix(frame.height) == YuvMatrix::bt601) return "";
  if (of_software)
    return "names no colour matrix: read as Rec. 601 with chroma amid the pixels, as OpenCV and ffmpeg write RGB; if "
           "ffmpeg wrote a camera's video anew: --colour-matrix bt709 --chroma-location left";
  return fmt::format(
      "names no colour matrix: read as Rec. 709, as it is {} rows high; if OpenCV or ffmpeg wrote it from RGB: "
      "--colour-matrix bt601 --chroma-location centre",
      frame.height);
}

}  // namespace lapservo::internal
