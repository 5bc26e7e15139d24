#include "lapservo/calibration/colour/marker_light.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "lapservo/calibration/camera/response_fit.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/colour/colour_classes.h"
#include "lapservo/vision/edges/edge_lines.h"
#include "lapservo/vision/image/light_image.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t least_edges = 200;
// By how much another response must bring the channels nearer to each other, and of its scatter over the edges.
constexpr double least_gain_px = 0.01, least_sigmas = 4;
constexpr int reach_px = 6;
// A lens' and a little more: what it is hardly moves edges.
constexpr float blur_px = 1.1F;

struct Place {
  Eigen::Vector2d centre_px, direction;
};

// Points of the inner boundaries that face the camera, and the shaft's direction in the image there.
std::vector<Place> places_of(const Camera& camera, const Marker& marker, const ShaftPose& pose) {
  constexpr int lines = 9;
  constexpr double reach = 0.6, seam_m = 0.5e-3;
  std::vector<Place> places;
  const auto view = view_cylinder(pose.camera_from_unrolled, marker.radius_m());
  if (!view) return places;
  for (int i = 0; i < lines; ++i) {
    const double azimuth_rad = visible_azimuth_rad(*view, reach, i, lines);
    const double tau_rad = marker_azimuth_rad(marker, azimuth_rad, pose.psi_rad);
    if (distance_to_seam_rad(marker, tau_rad) * marker.radius_m() < seam_m) continue;
    const auto ends_m = boundaries_m(marker, tau_rad);
    for (const std::size_t k : {1U, 2U}) {
      const auto px = [&](double along_m) {
        return camera.raw_from_point(pose.camera_from_unrolled *
                                     surface_point(marker.radius_m(), azimuth_rad, along_m));
      };
      const double room_m = std::min(ends_m[k] - ends_m[k - 1], ends_m[k + 1] - ends_m[k]);
      const Eigen::Vector2d centre = px(ends_m[k]), along = px(ends_m[k] + 0.5 * room_m) - centre;
      // The next boundary must not show in the profile.
      if (along.norm() < reach_px) continue;
      places.push_back({centre, along.normalized()});
    }
  }
  return places;
}

// The lines through them that lie inside the image and show no clipped light.
std::vector<EdgeLine> lines_of(const LightImage& light, const std::vector<Place>& places) {
  std::vector<EdgeLine> lines;
  for (const Place& place : places) {
    const Eigen::Vector2f at = place.centre_px.cast<float>(), along = place.direction.cast<float>();
    bool clear = light.contains(place.centre_px - reach_px * place.direction) &&
                 light.contains(place.centre_px + reach_px * place.direction);
    for (int i = -reach_px; clear && i <= reach_px; ++i) {
      const Eigen::Vector2f px = at + static_cast<float>(i) * along;
      const auto saturated = light.at(px.x(), px.y()).saturated;
      clear = !saturated[0] && !saturated[1] && !saturated[2];
    }
    if (clear) lines.push_back({at.x(), at.y(), along.x(), along.y(), reach_px, reach_px, blur_px});
  }
  return lines;
}

// Where each channel shows an edge, if it shows it, and by how much its light changes there.
using ChannelEdges = std::array<EdgeFit, 3>;

// `alone`: the image with one channel, the others black.
std::vector<ChannelEdges> edges_of(const std::array<cv::Mat, 3>& alone, const LightTable& light_of_value,
                                   const ChannelGeometry& channels, const std::vector<EdgeLine>& lines) {
  std::vector<ChannelEdges> edges(lines.size());
  for (std::size_t c = 0; c < 3; ++c) {
    const ImageView view(alone[c]);
    const EdgeFits fits = locate_edges(LightImage(view, light_of_value, channels), lines, 8);
    for (std::size_t i = 0; i < lines.size(); ++i) edges[i][c] = fits[i];
  }
  return edges;
}

// By how much the edges of channels that rise lie beyond those of channels that fall; NaN where there are not both.
double disagreement_px(const ChannelEdges& edges) {
  constexpr float least_part = 0.1F, farthest_px = 2;  // least_part: of the largest change, less is noise
  std::array<float, 3> change{};                       // 0 where there is no edge
  for (std::size_t c = 0; c < 3; ++c)
    if (edges[c].converged && std::abs(edges[c].offset_px) <= farthest_px) change[c] = edges[c].step[c];
  const float least = least_part * std::max({std::abs(change[0]), std::abs(change[1]), std::abs(change[2])});
  double rising = 0, falling = 0;
  int rise = 0, fall = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    if (std::abs(change[c]) < least) continue;
    if (change[c] > 0) rising += static_cast<double>(edges[c].offset_px), ++rise;
    if (change[c] < 0) falling += static_cast<double>(edges[c].offset_px), ++fall;
  }
  return rise > 0 && fall > 0 ? rising / rise - falling / fall : std::nan("");
}

// Neighbouring lines share pixels.
double sigma_of_median(std::vector<double> values, double median) {
  for (double& value : values) value -= median;
  return 3 * robust_scale(values) / std::sqrt(static_cast<double>(values.size()));
}

double typical_px(std::vector<double> apart_px) {
  for (double& apart : apart_px) apart = std::abs(apart);
  return median(apart_px);
}

}  // namespace

MarkerResponse::MarkerResponse(const Camera& camera) : camera_(camera) {
  candidates_.push_back({"as it is", camera.response, camera.response.table(), {}});
  for (const auto& [name, response] : named_responses()) candidates_.push_back({name, response, response.table(), {}});
}

void MarkerResponse::add(const cv::Mat& bgr, const Marker& marker, const ShaftPose& pose) {
  const ImageView view(bgr);
  const ChannelGeometry channels(camera_);
  const LightImage light(view, candidates_.front().light, channels);
  const std::vector<EdgeLine> lines = lines_of(light, places_of(camera_, marker, pose));
  std::array<cv::Mat, 3> alone;
  for (int c = 0; c < 3; ++c) {
    cv::Scalar kept;
    kept[c] = 255;
    cv::bitwise_and(bgr, kept, alone[static_cast<std::size_t>(c)]);
  }
  std::vector<std::vector<double>> apart_px(lines.size());  // of each edge, by the candidates
  for (const Candidate& candidate : candidates_) {
    const auto edges = edges_of(alone, candidate.light, channels, lines);
    for (std::size_t i = 0; i < lines.size(); ++i) apart_px[i].push_back(disagreement_px(edges[i]));
  }
  // Each edge counts for all or for none.
  for (const std::vector<double>& apart : apart_px)
    if (std::ranges::all_of(apart, [](double px) { return std::isfinite(px); }))
      for (std::size_t i = 0; i < apart.size(); ++i) candidates_[i].apart_px.push_back(apart[i]);
}

std::optional<MarkerResponse::Result> MarkerResponse::result() const {
  const std::vector<double>& own = candidates_.front().apart_px;
  if (own.size() < least_edges) return std::nullopt;
  Result result{{}, candidates_.front().name, typical_px(own), typical_px(own), 0, 0, own.size()};
  const Candidate* best = &candidates_.front();
  for (const Candidate& candidate : candidates_) {
    // Gains edge by edge: a property of one edge (specular light, a drop) is common to both.
    std::vector<double> gains;
    for (std::size_t i = 0; i < own.size(); ++i) gains.push_back(std::abs(own[i]) - std::abs(candidate.apart_px[i]));
    const double gain_px = median(std::vector(gains)), now_px = typical_px(candidate.apart_px);
    const double sigma_px = sigma_of_median(std::move(gains), gain_px);
    if (now_px < result.after_px && gain_px > std::max(least_gain_px, least_sigmas * sigma_px))
      result.after_px = now_px, result.name = candidate.name, result.better = candidate.response, best = &candidate;
  }
  result.left_px = median(std::vector(best->apart_px));
  result.sigma_left_px = sigma_of_median(best->apart_px, result.left_px);
  return result;
}

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
