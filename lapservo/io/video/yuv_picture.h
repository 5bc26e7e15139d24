#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include <opencv2/core.hpp>

#include "lapservo/io/pictures/transfer.h"

namespace lapservo::internal {

/// By their codes in ITU-T H.273, which are also FFmpeg's.
enum class YuvMatrix { bt709 = 1, fcc = 4, bt601 = 5, smpte240m = 7, bt2020 = 9 };
/// nullopt for other codes.
std::optional<YuvMatrix> yuv_matrix_of(int code);

/// Where the first sample of chroma lies, as seen from the first pixel of luma: on its column (left) or half a pixel
/// to the right of it, on its row (top), half a pixel below it or a pixel below it (bottom). Concerns only directions
/// in which chroma has fewer samples than luma. By FFmpeg's codes (AVChromaLocation).
enum class ChromaSite { left = 1, centre, top_left, top, bottom_left, bottom };

/// How luma and chroma become red, green and blue, and these sRGB.
struct YuvColours {
  YuvMatrix matrix = YuvMatrix::bt601;
  bool full_range = false;  ///< 0 to 255 and not 16 to 235
  ChromaSite chroma = ChromaSite::left;
  std::optional<Transfer> transfer{};  ///< that is undone; none: values stay as they are
  bool operator==(const YuvColours&) const = default;
};

/// Matrix of images without a tag: as in players and GStreamer, Rec. 709's from 720 rows on, else Rec. 601's.
inline YuvMatrix usual_matrix(int height_px) {
  return height_px >= 720 ? YuvMatrix::bt709 : YuvMatrix::bt601;
}

/// Luma and chroma in memory, 8 bits each.
struct YuvPicture {
  enum class Layout { yuyv, uyvy, nv12, planar_420, planar_422, planar_444 };
  Layout layout;
  cv::Size size;
  std::array<const std::uint8_t*, 4> planes{};
  std::array<int, 4> steps{};  ///< bytes a row
  bool by_field = false;       ///< the rows are two fields', each with its own chroma
};

/// 8-bit BGR of it; in the memory of `bgr` where that is of its size and type. False where it has no size that can be
/// converted.
bool convert_to_bgr(const YuvPicture& picture, const YuvColours& colours, cv::Mat& bgr);

}  // namespace lapservo::internal
