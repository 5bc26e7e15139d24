#include "lapservo/sim/chromatic_aberration.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <opencv2/imgproc.hpp>

namespace lapservo::internal {

int aberration_reach_px(const Camera& camera) {
  constexpr int lanczos_px = 4;
  const auto& [blue, red] = camera.chromatic_aberration;
  double moved = 0;  // at a distance of one
  for (const double magnification : {blue, red})
    moved = std::max({moved, std::abs(magnification - 1), std::abs(1 / magnification - 1)});
  if (moved == 0) return 0;
  const double corner_px = std::hypot(std::max(camera.cx_px, camera.width_px - camera.cx_px),
                                      std::max(camera.cy_px, camera.height_px - camera.cy_px));
  return static_cast<int>(std::ceil(moved * corner_px)) + lanczos_px;
}

void aberrate(const Camera& camera, const cv::Mat& light, const cv::Rect& part, cv::Mat& out) {
  cv::Mat to = out(part);
  light(part).copyTo(to);
  const int reach_px = aberration_reach_px(camera);
  const cv::Rect around =
      cv::Rect(part.x - reach_px, part.y - reach_px, part.width + 2 * reach_px, part.height + 2 * reach_px) &
      cv::Rect({0, 0}, light.size());
  const auto& [blue, red] = camera.chromatic_aberration;
  for (const auto& [channel, magnification] : {std::pair(0, blue), std::pair(2, red)}) {
    if (magnification == 1) continue;
    const double scale = 1 / magnification;
    const cv::Matx23d around_from_part(scale, 0, scale * part.x + camera.cx_px * (1 - scale) - around.x,  //
                                       0, scale, scale * part.y + camera.cy_px * (1 - scale) - around.y);
    cv::Mat plain, magnified;
    cv::extractChannel(light(around), plain, channel);
    cv::warpAffine(plain, magnified, around_from_part, part.size(), cv::INTER_LANCZOS4 | cv::WARP_INVERSE_MAP,
                   cv::BORDER_REPLICATE);
    cv::insertChannel(magnified, to, channel);
  }
}

}  // namespace lapservo::internal
