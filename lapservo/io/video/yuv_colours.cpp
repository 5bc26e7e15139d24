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
#include "lapservo/io/video/video_reader.h"

namespace lapservo::internal {
namespace {

template <typename Value>
std::optional<Value> found_in(const std::map<std::string, Value>& values, const std::string& key) {
  const auto found = values.find(key);
  return found == values.end() ? std::nullopt : std::optional(found->second);
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

bool has_chroma(const AVFrame& frame) {
  const AVPixFmtDescriptor* const format = av_pix_fmt_desc_get(pixel_format_of(frame));
  return format && !is_rgb(frame) && format->nb_components >= 3;
}

ChromaSite usual_site(AVCodecID codec, AVColorSpace matrix) {
  constexpr std::array amid_pixels{
      AV_CODEC_ID_MJPEG,     AV_CODEC_ID_WEBP,      AV_CODEC_ID_THEORA, AV_CODEC_ID_MPEG1VIDEO, AV_CODEC_ID_H261,
      AV_CODEC_ID_H263,      AV_CODEC_ID_H263I,     AV_CODEC_ID_H263P,  AV_CODEC_ID_FLV1,       AV_CODEC_ID_MSMPEG4V1,
      AV_CODEC_ID_MSMPEG4V2, AV_CODEC_ID_MSMPEG4V3, AV_CODEC_ID_WMV1,   AV_CODEC_ID_WMV2};
  if (std::find(amid_pixels.begin(), amid_pixels.end(), codec) != amid_pixels.end()) return ChromaSite::centre;
  return matrix == AVCOL_SPC_BT2020_NCL ? ChromaSite::top_left : ChromaSite::left;
}

// Decoders of H.264, H.265 and MPEG-4 say left where the stream says nothing.
ChromaSite site_of(const AVFrame& frame, AVCodecID codec, bool from_rgb) {
  static_assert(static_cast<int>(ChromaSite::bottom) == AVCHROMA_LOC_BOTTOM);
  const bool is_known = frame.chroma_location >= AVCHROMA_LOC_LEFT && frame.chroma_location <= AVCHROMA_LOC_BOTTOM;
  const auto site = is_known ? std::optional(static_cast<ChromaSite>(frame.chroma_location)) : std::nullopt;
  if (from_rgb && (!site || *site == ChromaSite::left)) return ChromaSite::centre;
  return site.value_or(usual_site(codec, frame.colorspace));
}

}  // namespace

bool is_codec_of_recorders(AVCodecID codec) {
  constexpr std::array codecs{AV_CODEC_ID_PRORES, AV_CODEC_ID_DNXHD, AV_CODEC_ID_CFHD,
                              AV_CODEC_ID_HQX,    AV_CODEC_ID_V210,  AV_CODEC_ID_JPEG2000};
  return std::find(codecs.begin(), codecs.end(), codec) != codecs.end();
}

std::string expected_transfer(const AVFrame& frame) {
  const AVPixFmtDescriptor* const format = av_pix_fmt_desc_get(pixel_format_of(frame));
  switch (frame.color_trc) {
    case AVCOL_TRC_LOG:
    case AVCOL_TRC_LOG_SQRT:
    case AVCOL_TRC_SMPTE428:
      return "bt709 or another of cameras (convert it: ffmpeg -i IN -vf zscale=transfer=bt709 OUT)";
    case AVCOL_TRC_SMPTE2084:
    case AVCOL_TRC_LINEAR:
      return format && format->log2_chroma_w + format->log2_chroma_h > 0
                 ? "bt709 or HLG, or chroma of full size (4:4:4): subsampled in PQ or linear light, it "
                   "shifts boundaries of colours (set "
                   "the recorder to SDR)"
                 : "";
    default:
      return "";
  }
}

bool names_software_encoder(std::span<const std::uint8_t> bytes) {
  using namespace std::string_view_literals;
  constexpr std::array names{"x264 - core"sv, "x265 (build"sv, "Lavc"sv};
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return std::ranges::any_of(names, [&](std::string_view name) { return text.find(name) != std::string_view::npos; });
}

GivenColours given_colours(const std::string& colour_matrix, const std::string& chroma_location) {
  static const std::map<std::string, YuvMatrix> matrices{
      {"bt601", YuvMatrix::bt601}, {"bt709", YuvMatrix::bt709}, {"bt2020", YuvMatrix::bt2020}};
  static const std::map<std::string, ChromaSite> sites{
      {"left", ChromaSite::left}, {"centre", ChromaSite::centre}, {"top-left", ChromaSite::top_left}};
  const GivenColours given{found_in(matrices, colour_matrix), found_in(sites, chroma_location)};
  if (!colour_matrix.empty() && !given.matrix)
    throw InputError("colour matrix", "is " + colour_matrix + ", expected bt601, bt709 or bt2020");
  if (!chroma_location.empty() && !given.chroma)
    throw InputError("chroma location", "is " + chroma_location + ", expected left, centre or top-left");
  return given;
}

std::optional<YuvColours> yuv_colours_of(const AVFrame& frame, AVCodecID codec, bool of_software,
                                         const GivenColours& given) {
  if (is_rgb(frame)) return YuvColours{.transfer = transfer_of_code(frame.color_trc)};
  const bool from_rgb = of_software && names_no_matrix(frame);
  YuvColours colours;
  if (given.matrix) {
    colours.matrix = *given.matrix;
  } else if (names_no_matrix(frame)) {
    colours.matrix = from_rgb ? YuvMatrix::bt601 : usual_matrix(frame.height);
  } else if (const auto matrix = yuv_matrix_of(frame.colorspace)) {
    colours.matrix = *matrix;
  } else {
    return std::nullopt;
  }
  colours.transfer = transfer_of_code(frame.color_trc);
  colours.full_range = pixel_format_of(frame) != frame.format || frame.color_range == AVCOL_RANGE_JPEG;
  colours.chroma = given.chroma.value_or(site_of(frame, codec, from_rgb));
  return colours;
}

std::string remark_on_matrix(const AVFrame& frame, bool of_software) {
  if (!has_chroma(frame) || !names_no_matrix(frame) || usual_matrix(frame.height) == YuvMatrix::bt601) return "";
  if (of_software)
    return "names no colour matrix: read as Rec. 601 with chroma amid the pixels, as OpenCV and ffmpeg write RGB; if "
           "ffmpeg wrote a camera's video anew: --colour-matrix bt709 --chroma-location left";
  return fmt::format(
      "names no colour matrix: read as Rec. 709, as it is {} rows high; if OpenCV or ffmpeg wrote it from RGB: "
      "--colour-matrix bt601 --chroma-location centre",
      frame.height);
}

std::string remark_on_given(const AVFrame& frame, const GivenColours& given) {
  return (given.matrix || given.chroma) && !has_chroma(frame) ? ignored_colours_text : "";
}

}  // namespace lapservo::internal
