#include "lapservo/calibration/colour/marker_response.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lapservo/calibration/fit/robust_scale.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/edges/edge_profile.h"
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

// False where light is clipped.
bool sample(const LightImage& light, const Place& place, EdgeProfile& profile) {
  if (!light.contains(place.centre_px - reach_px * place.direction) ||
      !light.contains(place.centre_px + reach_px * place.direction))
    return false;
  profile.first_px = -reach_px, profile.count = 2 * reach_px + 1;
  for (std::size_t i = 0; i < profile.count; ++i) {
    const Eigen::Vector2f at = (place.centre_px + (static_cast<double>(i) - reach_px) * place.direction).cast<float>();
    const auto seen = light.at(at.x(), at.y());
    for (std::size_t c = 0; c < 3; ++c) {
      if (seen.saturated[c]) return false;
      profile.light[c][i] = seen.light[c], profile.usable[c][i] = true;
    }
  }
  return true;
}

// Where a channel's edge lies along the profile, and how much light changes there; nullopt where it has none.
struct ChannelEdge {
  double offset_px, change;
};
std::optional<ChannelEdge> edge_of(EdgeProfile profile, std::size_t channel) {
  for (std::size_t c = 0; c < 3; ++c)
    if (c != channel) profile.usable[c].fill(false);
  const EdgeFit fit = fit_step(profile, blur_px, 8);
  if (!fit.converged || std::abs(fit.offset_px) > 2) return std::nullopt;
  return ChannelEdge{static_cast<double>(fit.offset_px), static_cast<double>(fit.step[channel])};
}

// By how much the edges of channels that rise lie beyond those of channels that fall; NaN where there are not both.
double disagreement_px(const EdgeProfile& profile) {
  constexpr double least_part = 0.1;  // of the largest change: less is noise
  std::array<std::optional<ChannelEdge>, 3> edges;
  double largest = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    edges[c] = edge_of(profile, c);
    if (edges[c]) largest = std::max(largest, std::abs(edges[c]->change));
  }
  double rising = 0, falling = 0;
  int rise = 0, fall = 0;
  for (const auto& edge : edges) {
    if (!edge || std::abs(edge->change) < least_part * largest) continue;
    if (edge->change > 0)
      rising += edge->offset_px, ++rise;
    else
      falling += edge->offset_px, ++fall;
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
  const auto add = [&](const char* name, const Response& response) {
    candidates_.push_back({name, response, response.table(), {}});
  };
  add("as it is", camera.response);
  add("srgb", {Response::Kind::srgb}), add("rec709", {Response::Kind::rec709}), add("linear", {Response::Kind::power});
  for (const auto& [name, gamma] :
       {std::pair("gamma:1.8", 1.8), {"gamma:2", 2.0}, {"gamma:2.2", 2.2}, {"gamma:2.4", 2.4}})
    add(name, {Response::Kind::power, gamma});
}

void MarkerResponse::add(const cv::Mat& bgr, const Marker& marker, const ShaftPose& pose) {
  const ImageView view(bgr);
  const ChannelGeometry channels(camera_);
  for (const Place& place : places_of(camera_, marker, pose)) {
    std::vector<double> all;
    for (const Candidate& candidate : candidates_) {
      EdgeProfile profile;
      if (!sample(LightImage(view, candidate.light, channels), place, profile)) break;
      all.push_back(disagreement_px(profile));
      if (!std::isfinite(all.back())) break;
    }
    // Each edge counts for all or for none.
    if (all.size() != candidates_.size() || !std::isfinite(all.back())) continue;
    for (std::size_t i = 0; i < all.size(); ++i) candidates_[i].apart_px.push_back(all[i]);
  }
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

}  // namespace lapservo::internal
