#include "lapservo/calibration/colour/light.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "lapservo/core/statistics.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/colour/colour_classes.h"
#include "lapservo/vision/image/light_image.h"

namespace lapservo::internal {

std::optional<MarkerLight> light_of_marker(const cv::Mat& bgr, const Camera& camera, const Marker& marker,
                                           const ShaftPose& pose) {
  constexpr int azimuths = 13, places = 60;
  constexpr double clear_px = 3;
  constexpr double reach = 0.7;  // of the visible half angle: beyond, it is dark and the background is near
  const auto view = view_cylinder(pose.camera_from_unrolled, marker.radius_m());
  if (!view) return std::nullopt;
  const double clear_m = clear_px / (camera.fx_px / std::max(1e-3, pose.camera_from_unrolled.translation.z()));
  std::vector<double> values, chromas;
  std::array<std::vector<double>, 3> beyond_deg;
  std::size_t clipped = 0;
  for (int i = 0; i < azimuths; ++i) {
    const double azimuth_rad = visible_azimuth_rad(*view, reach, i, azimuths);
    const double tau_rad = marker_azimuth_rad(marker, azimuth_rad, pose.psi_rad);
    if (distance_to_seam_rad(marker, tau_rad) * marker.radius_m() < clear_m) continue;
    const auto ends_m = boundaries_m(marker, tau_rad);
    for (int k = 0; k < places; ++k) {
      const double along_m = ends_m[0] + (ends_m[3] - ends_m[0]) * (k + 0.5) / places;
      std::size_t band = 0;
      bool clear = true;
      for (std::size_t e = 0; e < 4; ++e) clear &= std::abs(along_m - ends_m[e]) > clear_m;
      while (band < 2 && along_m >= ends_m[band + 1]) ++band;
      const Eigen::Vector3d point = pose.camera_from_unrolled * surface_point(marker.radius_m(), azimuth_rad, along_m);
      if (!clear || !(point.z() > 1e-3)) continue;
      const Eigen::Vector2d px = camera.raw_from_point(point);
      if (!camera.contains(px, 1)) continue;
      const auto& pixel =
          bgr.at<cv::Vec3b>(static_cast<int>(std::lround(px.y())), static_cast<int>(std::lround(px.x())));
      const auto [low, high] = std::minmax({pixel[0], pixel[1], pixel[2]});
      values.push_back(high), chromas.push_back(high - low);
      clipped += high >= LightImage::saturated_value;
      if (const auto hue_deg = hue_deg_of(pixel[0], pixel[1], pixel[2]))
        beyond_deg[band].push_back(std::remainder(*hue_deg - marker.hues_deg[band], 360.0));
    }
  }
  if (values.empty()) return std::nullopt;
  MarkerLight light;
  light.clipped = static_cast<double>(clipped) / static_cast<double>(values.size());
  light.value = median(values), light.chroma = median(chromas);
  for (std::size_t band = 0; band < 3; ++band)
    light.hues_deg[band] = marker.hues_deg[band] + (beyond_deg[band].empty() ? 0 : median(beyond_deg[band]));
  return light;
}

PictureLight light_of_picture(const cv::Mat& bgr) {
  constexpr int every = 16;  // pixels
  std::vector<int> brightest;
  int clipped = 0;
  for (int v = every / 2; v < bgr.rows; v += every)
    for (int u = every / 2; u < bgr.cols; u += every) {
      const auto& pixel = bgr.at<cv::Vec3b>(v, u);
      brightest.push_back(std::max({pixel[0], pixel[1], pixel[2]}));
      clipped += brightest.back() >= LightImage::saturated_value;
    }
  if (brightest.empty()) return {};
  const double share = static_cast<double>(clipped) / static_cast<double>(brightest.size());
  return {static_cast<double>(quantile(brightest, 0.9)), share};
}

}  // namespace lapservo::internal
