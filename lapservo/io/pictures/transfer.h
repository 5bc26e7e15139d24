#pragma once

#include <optional>
#include <string>

#include <opencv2/core.hpp>

namespace lapservo::internal {

/// How a file says that its values encode light, where that is not as cameras do (sRGB, Rec. 709 and their like).
struct Transfer {
  enum class Kind { power, hlg, pq };
  Kind kind = Kind::power;
  double gamma = 1;  ///< for Kind::power: light = value^gamma
  bool operator==(const Transfer&) const = default;
};

/// By a code of ITU-T H.273, as PNG, FFmpeg and GStreamer have it; nullopt for those of cameras, which the rig's
/// response describes.
std::optional<Transfer> transfer_of_code(int code);

/// "HLG", "gamma 2.60"; "a camera's" without one.
std::string name_of(const std::optional<Transfer>& transfer);

/// That it is undone.
std::string remark_on_transfer(const Transfer& transfer);

/// The light of 16-bit BGR in sRGB of 8 bits. White is that of HLG's and PQ's graphics (75 % and 203 cd/m2); light
/// beyond it is cut off.
cv::Mat srgb_of(const cv::Mat& bgr16, const Transfer& transfer);

}  // namespace lapservo::internal
