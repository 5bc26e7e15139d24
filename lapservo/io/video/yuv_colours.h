#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "lapservo/io/video/libav.h"
#include "lapservo/io/video/yuv_picture.h"

namespace lapservo::internal {

/// Whether recorders and editors write it, rather than programs that encode RGB: ProRes, DNxHD, CineForm, Canopus HQX,
/// uncompressed 4:2:2 of 10 bits, JPEG 2000.
bool is_codec_of_recorders(AVCodecID codec);

/// Whether the first bytes of a stream name x264, x265 or an encoder of libavcodec.
bool names_software_encoder(std::span<const std::uint8_t> bytes);

/// In place of what a stream names.
struct GivenColours {
  std::optional<YuvMatrix> matrix;
  std::optional<ChromaSite> chroma;
};

/// By the words of VideoReading, of which each may be empty. Throws InputError for others.
GivenColours given_colours(const std::string& colour_matrix, const std::string& chroma_location);

/// By `given`, else by the frame's tags (AVFrame::colorspace, color_range, chroma_location), which decoders take from
/// the stream. Without a matrix usual_matrix(), without a range the limited one. Without a place of chroma the
/// format's: amid the pixels (JPEG, MPEG-1, H.263 and their kin), top left (Rec. 2020), else left. `of_software`: a
/// software encoder wrote the stream; where that names no matrix either, swscale made it of RGB, as for OpenCV and
/// `ffmpeg` without options, by Rec. 601's matrix and with chroma amid the pixels, whatever the height. The
/// transfer is that of the frame's tag (AVFrame::color_trc) where it is not a camera's. Nullopt for a matrix that
/// swscale does not know.
std::optional<YuvColours> yuv_colours_of(const AVFrame& frame, AVCodecID codec, bool of_software,
                                         const GivenColours& given);

/// The expectation in place of a transfer that is not undone: logarithms, that of cinemas, and PQ and linear light with
/// fewer samples of chroma than of luma, which shift boundaries of colours. Empty for others.
std::string expected_transfer(const AVFrame& frame);

/// How a frame without a matrix is read, in words, where players would read it otherwise than OpenCV or FFmpeg may have
/// written it; else empty.
std::string remark_on_matrix(const AVFrame& frame, bool of_software);

/// Where something is given and the frame, of RGB or grey, has no use for it: that, in words; else empty.
std::string remark_on_given(const AVFrame& frame, const GivenColours& given);

}  // namespace lapservo::internal
