#include "lapservo/vision/search/rcm_starts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "lapservo/core/angles.h"
#include "lapservo/core/statistics.h"
#include "lapservo/vision/search/line_segmentation.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t line_count = 32, line_samples = 112, most_starts = 3;

// Rays of the camera by their angles: alpha about the direction to the RCM, beta from it. A shaft's axis lies on one
// alpha, from the RCM (beta = 0) to its tip.
class RaysFromRcm {
 public:
  explicit RaysFromRcm(const Rigid3& camera_from_rcm) : pole_(camera_from_rcm.translation.normalized()) {
    first_ = pole_.unitOrthogonal();
    second_ = pole_.cross(first_);
  }
  double alpha_rad(const Eigen::Vector3d& ray) const { return std::atan2(ray.dot(second_), ray.dot(first_)); }
  double beta_rad(const Eigen::Vector3d& ray) const {
    return std::acos(std::clamp(ray.normalized().dot(pole_), -1.0, 1.0));
  }
  const Eigen::Vector3d& pole() const { return pole_; }
  Eigen::Vector3d across(double alpha_rad) const {
    return std::cos(alpha_rad) * first_ + std::sin(alpha_rad) * second_;
  }
  Eigen::Vector3d ray(double alpha_rad, double beta_rad) const {
    return std::cos(beta_rad) * pole_ + std::sin(beta_rad) * across(alpha_rad);
  }

 private:
  Eigen::Vector3d pole_, first_, second_;
};

// The part of the rays that a blob lies in.
struct Fan {
  double first_alpha_rad, step_alpha_rad, first_beta_rad, step_beta_rad;
  double alpha_rad(double line) const { return first_alpha_rad + line * step_alpha_rad; }
  double beta_rad(double sample) const { return first_beta_rad + sample * step_beta_rad; }
};

// By band, the cosines of its samples' betas.
using BandCosines = std::array<std::vector<double>, 3>;

// Whether the middle band and another one show, as the inner boundaries show psi, and no band lies wholly on the wrong
// side of its neighbour, as in another marker's order. A blob of several markers may have all orders.
bool may_be_in_order(BandCosines& bands) {
  constexpr std::size_t min_samples = 2;
  constexpr double quarter = 0.25;
  const auto shows = [&](std::size_t band) { return bands[band].size() >= min_samples; };
  const auto is_contradicted = [&](std::size_t band) {
    return shows(band) && shows(band + 1) && quantile(bands[band], 1 - quarter) < quantile(bands[band + 1], quarter);
  };
  return shows(1) && (shows(0) || shows(2)) && !is_contradicted(0) && !is_contradicted(1);
}

// Over a blob's samples of the marker's colours, and as far beyond them as they are apart. Nullopt where they lie in
// another order, or on all sides of the RCM's image: the shaft points at the camera.
std::optional<Fan> fan_over(const Scene& scene, const Blob& blob, const RaysFromRcm& rays) {
  constexpr double least_sine = 0.05;
  std::optional<double> alpha_rad;  // of the first sample
  Eigen::Vector3d ahead, aside;
  double least_tangent = 1e9, most_tangent = -1e9, least_cosine = 1, most_cosine = -1;
  BandCosines bands;
  for (const Blob::Sample& sample : blob.samples) {
    const auto band = std::find(scene.bands.begin(), scene.bands.end(), sample.colour);
    if (band == scene.bands.end()) continue;
    const auto ideal_px = scene.camera.ideal_from_raw(Eigen::Vector2d(sample.u, sample.v));
    if (!ideal_px) continue;
    const Eigen::Vector3d ray = scene.camera.ray_from_ideal(*ideal_px).normalized();
    if (!alpha_rad) {
      alpha_rad = rays.alpha_rad(ray);
      ahead = rays.across(*alpha_rad), aside = rays.pole().cross(ahead);
    }
    if (!(ray.dot(ahead) > 0)) return std::nullopt;
    const double tangent = ray.dot(aside) / ray.dot(ahead), cosine = ray.dot(rays.pole());
    least_tangent = std::min(least_tangent, tangent), most_tangent = std::max(most_tangent, tangent);
    least_cosine = std::min(least_cosine, cosine), most_cosine = std::max(most_cosine, cosine);
    bands[static_cast<std::size_t>(band - scene.bands.begin())].push_back(cosine);
  }
  if (!may_be_in_order(bands)) return std::nullopt;
  const double first_beta = std::acos(std::min(1.0, most_cosine)), last_beta = std::acos(std::max(-1.0, least_cosine));
  const double alpha_margin_rad =
      blob.grid_px / scene.camera.fx_px / std::max(least_sine, std::sin((first_beta + last_beta) / 2));
  const double beta_margin_rad = 0.2 * (last_beta - first_beta) + 0.01;
  const double first_alpha_rad = *alpha_rad + std::atan(least_tangent) - alpha_margin_rad;
  const double last_alpha_rad = *alpha_rad + std::atan(most_tangent) + alpha_margin_rad;
  const double from_rad = std::max(0.0, first_beta - beta_margin_rad);
  const double to_rad = std::min(pi, last_beta + beta_margin_rad);
  return Fan{first_alpha_rad, (last_alpha_rad - first_alpha_rad) / (line_count - 1), from_rad,
             (to_rad - from_rad) / line_samples};
}

// A line's split into the bands, and how well it agrees [samples].
struct Line {
  LineSegmentation split;
  double score = 0;
  double length() const { return split.position[3] - split.position[0]; }
};

using Lines = std::array<Line, line_count>;

// Cosine and sine of each sample's beta: all lines have the same.
using Samples = std::array<Eigen::Vector2d, line_samples>;

Samples samples_of(const Fan& fan) {
  Samples samples;
  for (std::size_t k = 0; k < line_samples; ++k) {
    const double beta_rad = fan.beta_rad(static_cast<double>(k) + 0.5);
    samples[k] = {std::cos(beta_rad), std::sin(beta_rad)};
  }
  return samples;
}

std::uint8_t class_on_ray(const Scene& scene, const Eigen::Vector3d& ray) {
  return scene.field.contains(ray) ? scene.class_beside(scene.camera.raw_from_point(ray)) : Scene::outside;
}

Line line_at(const Scene& scene, const RaysFromRcm& rays, double alpha_rad, const Samples& samples) {
  const Eigen::Vector3d across = rays.across(alpha_rad);
  std::array<std::uint8_t, line_samples> classes;
  for (std::size_t k = 0; k < line_samples; ++k) {
    const Eigen::Vector3d ray = samples[k].x() * rays.pole() + samples[k].y() * across;
    classes[k] = class_on_ray(scene, ray);
  }
  Line line{segment_line(classes, scene.bands)};
  std::size_t state = 0;
  for (std::size_t k = 0; k < line_samples; ++k) {
    while (state < 4 && static_cast<double>(k) >= line.split.position[state]) ++state;
    if (state >= 1 && state <= 3) line.score += line_reward(state, classes[k], scene.bands);
  }
  return line;
}

// Lines side by side that one shaft may show on.
struct Window {
  std::size_t middle = 0;
  int half = 0;  // lines
  double score = 0;
  bool has(std::size_t line) const { return std::abs(static_cast<int>(line) - static_cast<int>(middle)) <= half; }
};

// As wide as a marker is that looks as long as on the middle line.
Window window_about(const Scene& scene, const Fan& fan, const Lines& lines, std::size_t middle) {
  Window window{middle};
  const Line& line = lines[middle];
  const double length_rad = line.length() * fan.step_beta_rad;
  const double beta_rad = fan.beta_rad((line.split.position[0] + line.split.position[3]) / 2);
  const double half_rad = 0.8 * scene.marker.radius_m() / scene.marker.length_m() * length_rad;
  window.half = static_cast<int>(half_rad / std::max(0.05, std::sin(beta_rad)) / fan.step_alpha_rad);
  for (std::size_t i = 0; i < line_count; ++i)
    if (window.has(i)) window.score += lines[i].score;
  return window;
}

std::vector<Window> best_windows(const Scene& scene, const Fan& fan, const Lines& lines) {
  constexpr double least = 0.3;  // of the best
  std::vector<Window> all, best;
  for (std::size_t i = 0; i < line_count; ++i)
    if (lines[i].score > 0) all.push_back(window_about(scene, fan, lines, i));
  std::sort(all.begin(), all.end(), [](const Window& a, const Window& b) { return a.score > b.score; });
  for (const Window& window : all) {
    if (best.size() == most_starts || window.score < least * all[0].score) break;
    if (std::none_of(best.begin(), best.end(), [&](const Window& other) { return other.has(window.middle); }))
      best.push_back(window);
  }
  return best;
}

// A window's view of the marker.
struct Extent {
  double alpha_rad, width_rad;
  std::optional<double> first_beta_rad, last_beta_rad;
  std::optional<double> only_side_rad;  // alpha of the side that shows where the other one is hidden, and in
  double away_from_side = 0;            // which direction of alpha the axis lies
  double sine_of_beta = 1;
};

// Whether nothing shows beside a line of the fan, by the image's border or another instrument, on most places from
// first to last.
bool is_hidden(const Scene& scene, const RaysFromRcm& rays, double alpha_rad, double first_beta_rad,
               double last_beta_rad) {
  constexpr int places = 5;
  int hidden = 0;
  for (int i = 0; i < places; ++i) {
    const Eigen::Vector3d ray =
        rays.ray(alpha_rad, first_beta_rad + (last_beta_rad - first_beta_rad) * (i + 0.5) / places);
    hidden += class_on_ray(scene, ray) == Scene::outside;
  }
  return 2 * hidden > places;
}

Extent extent_of(const Scene& scene, const RaysFromRcm& rays, const Fan& fan, const Lines& lines,
                 const Window& window) {
  double most = 0;
  for (std::size_t i = 0; i < line_count; ++i)
    if (window.has(i)) most = std::max(most, lines[i].score);
  std::vector<double> first, last;
  double sum = 0, lowest = line_count, highest = 0;
  int count = 0;
  for (std::size_t i = 0; i < line_count; ++i) {
    if (!window.has(i) || lines[i].score < most / 2) continue;
    const auto place = static_cast<double>(i);
    sum += place, ++count, lowest = std::min(lowest, place), highest = std::max(highest, place);
    if (lines[i].split.seen[0]) first.push_back(fan.beta_rad(lines[i].split.position[0]));
    if (lines[i].split.seen[3]) last.push_back(fan.beta_rad(lines[i].split.position[3]));
  }
  Extent extent{fan.alpha_rad(sum / count), 0, agreed_end(first), agreed_end(last)};
  const Line& middle = lines[window.middle];
  const double from_rad = fan.beta_rad(middle.split.position[0]), to_rad = fan.beta_rad(middle.split.position[3]);
  extent.sine_of_beta = std::sin((from_rad + to_rad) / 2);
  extent.width_rad = (highest - lowest + 1) * fan.step_alpha_rad * extent.sine_of_beta;
  const double low_rad = fan.alpha_rad(lowest - 1), high_rad = fan.alpha_rad(highest + 1);
  const bool low_hidden = is_hidden(scene, rays, low_rad, from_rad, to_rad);
  if (low_hidden == is_hidden(scene, rays, high_rad, from_rad, to_rad)) return extent;
  extent.only_side_rad = low_hidden ? high_rad : low_rad, extent.away_from_side = low_hidden ? -1 : 1;
  return extent;
}

// How far away the proximal end is, by the length that the marker shows; by its width where the length does not show
// it.
double distance_of(const Scene& scene, const RaysFromRcm& rays, const Extent& extent, double first_beta_rad,
                   double rcm_m) {
  constexpr int steps = 120;
  constexpr double nearest_m = 0.03, farthest_m = 0.4, sigma_rad = 0.005, sigma_log = 0.3;
  const double by_width_m = scene.marker.radius_m() / std::sin(std::min(1.0, extent.width_rad / 2));
  if (!extent.first_beta_rad || !extent.last_beta_rad) return by_width_m;
  const Eigen::Vector3d rcm = rcm_m * rays.ray(0, 0);
  double least = 1e300, best_m = by_width_m;
  for (int i = 0; i <= steps; ++i) {
    const double distance_m = nearest_m * std::pow(farthest_m / nearest_m, 1.0 * i / steps);
    const Eigen::Vector3d proximal = distance_m * rays.ray(extent.alpha_rad, first_beta_rad);
    const Eigen::Vector3d distal = proximal + scene.marker.length_m() * (proximal - rcm).normalized();
    const double cost = std::pow((rays.beta_rad(distal) - *extent.last_beta_rad) / sigma_rad, 2) +
                        std::pow(std::log(distance_m / by_width_m) / sigma_log, 2);
    if (cost < least) least = cost, best_m = distance_m;
  }
  return best_m;
}

std::optional<PoseUnknowns> start_of(const Scene& scene, const RaysFromRcm& rays, const Extent& extent,
                                     const Rigid3& camera_from_rcm) {
  if (!extent.first_beta_rad && !extent.last_beta_rad) return std::nullopt;
  const double rcm_m = camera_from_rcm.translation.norm();
  double first_beta_rad = extent.first_beta_rad.value_or(0);
  if (!extent.first_beta_rad) {
    // Seen squarely.
    const double distance_m = distance_of(scene, rays, extent, 0, rcm_m);
    first_beta_rad = *extent.last_beta_rad - scene.marker.length_m() / distance_m;
  }
  const double distance_m = distance_of(scene, rays, extent, first_beta_rad, rcm_m);
  double alpha_rad = extent.alpha_rad;
  if (extent.only_side_rad)
    alpha_rad = *extent.only_side_rad +
                extent.away_from_side * scene.marker.radius_m() / (distance_m * std::max(0.05, extent.sine_of_beta));
  const auto q = configuration_through(camera_from_rcm, distance_m * rays.ray(alpha_rad, first_beta_rad));
  return q ? std::optional(PoseUnknowns(pose_through_rcm(camera_from_rcm, *q), true)) : std::nullopt;
}

// For lines that are split as the scene shows them.
std::vector<PoseUnknowns> starts_on_lines(const Scene& scene, const RaysFromRcm& rays, const Fan& fan,
                                          const Rigid3& camera_from_rcm) {
  Lines lines;
  const Samples samples = samples_of(fan);
  for (std::size_t i = 0; i < line_count; ++i)
    lines[i] = line_at(scene, rays, fan.alpha_rad(static_cast<double>(i)), samples);
  std::vector<PoseUnknowns> starts;
  for (const Window& window : best_windows(scene, fan, lines))
    if (auto start = start_of(scene, rays, extent_of(scene, rays, fan, lines, window), camera_from_rcm))
      starts.push_back(std::move(*start));
  return starts;
}

}  // namespace

std::vector<PoseUnknowns> starts_through_rcm(const Scene& scene, const Blob& blob, const Rigid3& camera_from_rcm) {
  if (!(camera_from_rcm.translation.norm() > 1e-3)) return {};
  const RaysFromRcm rays(camera_from_rcm);
  const auto fan = fan_over(scene, blob, rays);
  if (!fan) return {};
  auto starts = starts_on_lines(scene, rays, *fan, camera_from_rcm);
  if (scene.others.empty()) return starts;
  Scene alone = scene;
  alone.others = {};
  const auto more = starts_on_lines(alone, rays, *fan, camera_from_rcm);
  starts.insert(starts.end(), more.begin(), more.end());
  return starts;
}

}  // namespace lapservo::internal
