#include "lapservo/io/video/bgr_converter.h"

#include <algorithm>
#include <utility>

extern "C" {
#include <libavutil/imgutils.h>
#include <libavutil/opt.h>
#include <libavutil/pixdesc.h>
}

#include "lapservo/io/pictures/picture_parts.h"

namespace lapservo::internal {
namespace {

static_assert(static_cast<int>(YuvMatrix::bt709) == SWS_CS_ITU709 && static_cast<int>(YuvMatrix::fcc) == SWS_CS_FCC &&
              static_cast<int>(YuvMatrix::bt601) == SWS_CS_ITU601 &&
              static_cast<int>(YuvMatrix::smpte240m) == SWS_CS_SMPTE240M &&
              static_cast<int>(YuvMatrix::bt2020) == SWS_CS_BT2020);

// Where chroma's first sample lies beside luma's, in 1/256 of a pixel of luma.
struct Place {
  int column = 0, row = 0;
};

Place place_of(ChromaSite site) {
  constexpr std::array<Place, 7> places{{{}, {0, 128}, {128, 128}, {0, 0}, {128, 0}, {0, 256}, {128, 256}}};
  return places.at(static_cast<std::size_t>(site));
}

bool is_rgb(const AVPixFmtDescriptor& format) {
  return (format.flags & (AV_PIX_FMT_FLAG_RGB | AV_PIX_FMT_FLAG_PAL)) != 0;
}
bool has_chroma(const AVPixFmtDescriptor& format) {
  return !is_rgb(format) && format.nb_components >= 3;
}

// Within a whole frame, or within the even (0) or the odd (1) rows. Between columns 4:1:1 has four of luma.
Place place_in(ChromaSite site, const AVPixFmtDescriptor& format, bool by_field, int field) {
  Place place = place_of(site);
  constexpr int quarter = 64;
  if (by_field && place.row == 128) place.row = field == 0 ? quarter : 3 * quarter;
  if (format.log2_chroma_h == 0) place.row = 0;
  if (place.column > 0) place.column = (128 << format.log2_chroma_w) - 128;
  return place;
}

libav::Scaler scaler_of(const cv::Size& size, AVPixelFormat format, const Place& chroma, AVPixelFormat to) {
  libav::Scaler scaler(sws_alloc_context());
  if (!scaler) return nullptr;
  const auto set = [&](const char* name, int value) { av_opt_set_int(scaler.get(), name, value, 0); };
  set("srcw", size.width), set("srch", size.height), set("src_format", format);
  set("dstw", size.width), set("dsth", size.height);
  set("dst_format", to);
  // Without SWS_ACCURATE_RND chroma is repeated. SWS_BICUBIC overshoots where an encoder's filter does already
  // (docs/notes/decisions.md).
  set("sws_flags", SWS_BILINEAR | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT | SWS_FULL_CHR_H_INP);
  set("src_h_chr_pos", chroma.column), set("src_v_chr_pos", chroma.row);
  return sws_init_context(scaler.get(), nullptr, nullptr) < 0 ? nullptr : std::move(scaler);
}

void set_colours(SwsContext& scaler, const YuvColours& colours) {
  constexpr int unity = 1 << 16;
  sws_setColorspaceDetails(&scaler, sws_getCoefficients(static_cast<int>(colours.matrix)), colours.full_range ? 1 : 0,
                           sws_getCoefficients(SWS_CS_DEFAULT), 1, 0, unity, unity);
}

// With room for what swscale writes beyond the ends of rows.
cv::Mat plane_of(const cv::Size& size, int depth) {
  constexpr int step = 64;
  return cv::Mat(size.height, (size.width / step + 2) * step, CV_MAKETYPE(depth, 1)).colRange(0, size.width);
}

// Planes or BGR; of 16 bits where a transfer is undone.
AVPixelFormat target_of(bool to_planes, bool deep) {
  if (to_planes) return deep ? AV_PIX_FMT_GBRP16 : AV_PIX_FMT_GBRP;
  return deep ? AV_PIX_FMT_BGR48 : AV_PIX_FMT_BGR24;
}

AVPixelFormat format_of(YuvPicture::Layout layout) {
  constexpr std::array formats{AV_PIX_FMT_YUYV422, AV_PIX_FMT_UYVY422, AV_PIX_FMT_NV12,
                               AV_PIX_FMT_YUV420P, AV_PIX_FMT_YUV422P, AV_PIX_FMT_YUV444P};
  return formats.at(static_cast<std::size_t>(layout));
}

// As grey images of BMP have it.
bool is_of_all_greys(const AVFrame& frame) {
  if (!frame.data[1]) return false;
  const cv::Mat_<cv::Vec4b> palette(1, 256, reinterpret_cast<cv::Vec4b*>(frame.data[1]));
  for (int i = 0; i < palette.cols; ++i)
    for (int channel = 0; channel < 3; ++channel)
      if (palette(0, i)[channel] != i) return false;
  return true;
}

}  // namespace

AVPixelFormat pixel_format_of(const AVFrame& frame) {
  using Pair = std::pair<AVPixelFormat, AVPixelFormat>;
  constexpr std::array full_range{
      Pair{AV_PIX_FMT_YUVJ420P, AV_PIX_FMT_YUV420P}, Pair{AV_PIX_FMT_YUVJ422P, AV_PIX_FMT_YUV422P},
      Pair{AV_PIX_FMT_YUVJ444P, AV_PIX_FMT_YUV444P}, Pair{AV_PIX_FMT_YUVJ440P, AV_PIX_FMT_YUV440P},
      Pair{AV_PIX_FMT_YUVJ411P, AV_PIX_FMT_YUV411P}};
  const auto found = std::ranges::find(full_range, frame.format, &Pair::first);
  return found != full_range.end() ? found->second : static_cast<AVPixelFormat>(frame.format);
}

// A GIF's decoder looks its palette up itself. Bayer's channels have 8 bits or more, whatever their description says.
std::string coarse_pixels(const AVFrame& frame, AVCodecID codec) {
  const AVPixFmtDescriptor* const format = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame.format));
  if (!format || (format->flags & AV_PIX_FMT_FLAG_BAYER) != 0) return "";
  int bits = format->comp[0].depth;
  for (int i = 1; i < format->nb_components; ++i) bits = std::min(bits, format->comp[i].depth);
  const bool has_palette = (format->flags & AV_PIX_FMT_FLAG_PAL) != 0 && !is_of_all_greys(frame);
  return coarse_pixels(codec == AV_CODEC_ID_GIF || has_palette, bits);
}

// To planes where there is chroma: three times as fast as to BGR, where swscale takes chroma from the wrong rows
// besides.
bool BgrConverter::set_up(const Source& source) {
  source_.reset();
  scalers_.clear();
  const AVPixFmtDescriptor& format = *av_pix_fmt_desc_get(source.format);
  const int fields = source.by_field ? 2 : 1;
  const bool deep = source.colours.transfer.has_value();
  const AVPixelFormat to = target_of(has_chroma(format), deep);
  const cv::Size size(source.width_px, source.height_px), scaled(size.width, size.height / fields);
  for (int field = 0; field < fields; ++field) {
    const Place chroma = place_in(source.colours.chroma, format, source.by_field, field);
    libav::Scaler scaler = scaler_of(scaled, source.format, chroma, to);
    if (!scaler) return false;
    if (!is_rgb(format)) set_colours(*scaler, source.colours);
    scalers_.push_back(std::move(scaler));
  }
  for (cv::Mat& plane : planes_) plane = has_chroma(format) ? plane_of(size, deep ? CV_16U : CV_8U) : cv::Mat();
  source_ = source;
  return true;
}

bool BgrConverter::convert(const AVFrame& frame, const YuvColours& colours, bool by_field, cv::Mat& bgr) {
  const AVPixelFormat format = pixel_format_of(frame);
  const AVPixFmtDescriptor* const description = av_pix_fmt_desc_get(format);
  if (!description) return false;
  const bool split = by_field && has_chroma(*description) && description->log2_chroma_h == 1 && frame.height % 4 == 0;
  const Source source{frame.width, frame.height, format, colours, split};
  if (source != source_ && !set_up(source)) return false;
  bgr.create(frame.height, frame.width, CV_8UC3);
  cv::Mat deep = colours.transfer ? cv::Mat(bgr.size(), CV_16UC3) : cv::Mat();
  cv::Mat& whole = colours.transfer ? deep : bgr;
  const bool to_planes = !planes_[0].empty();
  const int fields = static_cast<int>(scalers_.size());
  for (int field = 0; field < fields; ++field) {
    std::array<const std::uint8_t*, 4> from{};
    std::array<std::uint8_t*, 4> to{to_planes ? nullptr : whole.ptr(field)};
    std::array<int, 4> from_steps{}, to_steps{fields * static_cast<int>(whole.step)};
    for (std::size_t i = 0; i < 4; ++i) {
      from[i] = frame.data[i] ? frame.data[i] + field * frame.linesize[i] : nullptr;
      from_steps[i] = fields * frame.linesize[i];
      if (!to_planes || i == 3) continue;
      to[i] = planes_[i].ptr(field);
      to_steps[i] = fields * static_cast<int>(planes_[i].step);
    }
    sws_scale(scalers_[static_cast<std::size_t>(field)].get(), from.data(), from_steps.data(), 0, frame.height / fields,
              to.data(), to_steps.data());
  }
  if (to_planes) cv::merge(std::array{planes_[1], planes_[0], planes_[2]}, whole);
  if (colours.transfer) srgb_of(deep, *colours.transfer).copyTo(bgr);
  return true;
}

std::optional<YuvMatrix> yuv_matrix_of(int code) {
  constexpr int bt601_525 = 6;  // the same matrix as for 625 lines
  constexpr std::array codes{YuvMatrix::bt709, YuvMatrix::fcc, YuvMatrix::bt601, YuvMatrix::smpte240m,
                             YuvMatrix::bt2020};
  const auto matrix = static_cast<YuvMatrix>(code == bt601_525 ? static_cast<int>(YuvMatrix::bt601) : code);
  return std::ranges::find(codes, matrix) != codes.end() ? std::optional(matrix) : std::nullopt;
}

// swscale reads beyond the ends of rows: a copy has room for that.
bool convert_to_bgr(const YuvPicture& picture, const YuvColours& colours, cv::Mat& bgr) {
  thread_local BgrConverter converter;  // which serves images of one kind after another
  const AVPixelFormat format = format_of(picture.layout);
  const libav::Frame frame(av_frame_alloc());
  if (!frame) return false;
  frame->width = picture.size.width;
  frame->height = picture.size.height;
  frame->format = format;
  if (av_frame_get_buffer(frame.get(), 0) < 0) return false;
  auto planes = picture.planes;
  av_image_copy(frame->data, frame->linesize, planes.data(), picture.steps.data(), format, frame->width, frame->height);
  return converter.convert(*frame, colours, picture.by_field, bgr);
}

}  // namespace lapservo::internal
