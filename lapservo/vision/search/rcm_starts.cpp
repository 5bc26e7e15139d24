#include "lapservo/vision/search/rcm_starts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "lapservo/core/angles.h"
#include "lapservo/core/statistics.h"
#include "lapservo/vision/search/explained_colours.h"
#include "lapservo/vision/search/line_segmentation.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t line_count = 64, line_samples = 160, most_starts = 3;
// Of the middle band's colour (fraction_in_order): another's marker has at most 0.04, and crossing ones' mostly 0.16
// and more where one of them lies before the other.
constexpr double least_in_order = 0.1;

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
  Eigen::Vector3d ray(double alpha_rad, double beta_rad) const {
    return std::cos(beta_rad) * pole_ +
           std::sin(beta_rad) * (std::cos(alpha_rad) * first_ + std::sin(alpha_rad) * second_);
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

// A place of a blob that has one of the marker's colours.
struct Place {
  double alpha_rad, beta_rad;
  std::uint8_t colour;
};

// Alpha is continuous over the blob.
std::vector<Place> places_of(const Scene& scene, const Blob& blob, const RaysFromRcm& rays) {
  std::vector<Place> places;
  places.reserve(blob.samples.size());
  for (const Blob::Sample& sample : blob.samples) {
    if (!scene.is_ours(sample.colour)) continue;
    const auto ideal_px = scene.camera.ideal_from_raw(Eigen::Vector2d(sample.u, sample.v));
    if (!ideal_px) continue;
    const Eigen::Vector3d ray = scene.camera.ray_from_ideal(*ideal_px);
    const double alpha_rad = rays.alpha_rad(ray);
    const double middle_rad = places.empty() ? alpha_rad : places.front().alpha_rad;
    places.push_back({middle_rad + wrap_pi(alpha_rad - middle_rad), rays.beta_rad(ray), sample.colour});
  }
  return places;
}

std::optional<Fan> fan_over(const std::vector<Place>& places) {
  if (places.empty()) return std::nullopt;
  double first_alpha = 1e9, last_alpha = -1e9, first_beta = 1e9, last_beta = -1e9;
  for (const Place& place : places) {
    first_alpha = std::min(first_alpha, place.alpha_rad), last_alpha = std::max(last_alpha, place.alpha_rad);
    first_beta = std::min(first_beta, place.beta_rad), last_beta = std::max(last_beta, place.beta_rad);
  }
  // All round: the shaft points at the camera.
  if (last_alpha - first_alpha > pi) return std::nullopt;
  const double margin_rad = 0.2 * (last_beta - first_beta) + 0.01;
  first_beta = std::max(0.0, first_beta - margin_rad), last_beta = std::min(pi, last_beta + margin_rad);
  return Fan{first_alpha, std::max(1e-6, (last_alpha - first_alpha) / (line_count - 1)), first_beta,
             (last_beta - first_beta) / line_samples};
}

// How much of the middle band's colour lies between the others, as seen from the RCM, as in a marker that nothing hides
// and of which most shows. In another's, whose bands have another order, it doesn't, and to see that costs next to
// nothing.
double fraction_in_order(const Scene& scene, const Fan& fan, const std::vector<Place>& places) {
  constexpr std::size_t parts = 16;
  struct Part {
    std::vector<double> first_rad, last_rad;  // the first band's places and the last one's
  };
  std::array<Part, parts> all;
  const auto part_of = [&](const Place& place) -> Part& {
    const double line = (place.alpha_rad - fan.first_alpha_rad) / fan.step_alpha_rad;
    return all[std::min(parts - 1, static_cast<std::size_t>(std::max(0.0, line)) * parts / line_count)];
  };
  for (const Place& place : places) {
    if (place.colour == scene.bands[0]) part_of(place).first_rad.push_back(place.beta_rad);
    if (place.colour == scene.bands[2]) part_of(place).last_rad.push_back(place.beta_rad);
  }
  int middle = 0, in_order = 0;
  for (const Place& place : places) {
    if (place.colour != scene.bands[1]) continue;
    const Part& part = part_of(place);
    const auto before = std::count_if(part.first_rad.begin(), part.first_rad.end(),
                                      [&](double beta_rad) { return beta_rad < place.beta_rad; });
    const auto behind = std::count_if(part.last_rad.begin(), part.last_rad.end(),
                                      [&](double beta_rad) { return beta_rad > place.beta_rad; });
    constexpr int enough = 3;
    ++middle, in_order += before >= enough && behind >= enough;
  }
  return in_order / std::max(1.0, static_cast<double>(middle));
}

// A line's split into the bands, and how well it agrees [samples].
struct Line {
  LineSegmentation split;
  double score = 0;
  double length() const { return split.position[3] - split.position[0]; }
};

using Lines = std::array<Line, line_count>;

Line line_at(const Scene& scene, const RaysFromRcm& rays, const Fan& fan, std::size_t i) {
  std::array<std::uint8_t, line_samples> classes;
  for (std::size_t k = 0; k < line_samples; ++k) {
    const Eigen::Vector3d ray =
        rays.ray(fan.alpha_rad(static_cast<double>(i)), fan.beta_rad(static_cast<double>(k) + 0.5));
    classes[k] = scene.field.contains(ray) ? scene.class_beside(scene.camera.raw_from_point(ray)) : Scene::outside;
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

// What a window shows of the marker.
struct Extent {
  double alpha_rad, width_rad;
  std::optional<double> first_beta_rad, last_beta_rad;
};

Extent extent_of(const Fan& fan, const Lines& lines, const Window& window) {
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
  const auto of_two_or_more = [](std::vector<double>& values) -> std::optional<double> {
    return values.size() < 2 ? std::nullopt : std::optional(median(values));
  };
  Extent extent{fan.alpha_rad(sum / count), 0, of_two_or_more(first), of_two_or_more(last)};
  const Line& middle = lines[window.middle];
  const double beta_rad = fan.beta_rad((middle.split.position[0] + middle.split.position[3]) / 2);
  extent.width_rad = (highest - lowest + 1) * fan.step_alpha_rad * std::sin(beta_rad);
  return extent;
}

// How far away the proximal end is, by the length that the marker shows; by its width where the length does not tell.
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
  const auto q = configuration_through(camera_from_rcm, distance_m * rays.ray(extent.alpha_rad, first_beta_rad));
  return q ? std::optional(PoseUnknowns::rcm(camera_from_rcm, *q)) : std::nullopt;
}

// Of lines that are split as the scene shows them.
std::vector<PoseUnknowns> starts_on_lines(const Scene& scene, const RaysFromRcm& rays, const Fan& fan,
                                          const Rigid3& camera_from_rcm) {
  Lines lines;
  for (std::size_t i = 0; i < line_count; ++i) lines[i] = line_at(scene, rays, fan, i);
  std::vector<PoseUnknowns> starts;
  for (const Window& window : best_windows(scene, fan, lines))
    if (auto start = start_of(scene, rays, extent_of(fan, lines, window), camera_from_rcm))
      starts.push_back(std::move(*start));
  return starts;
}

// By the area of colours that they explain, most first.
std::vector<PoseUnknowns> best_first(const Scene& scene, const std::vector<PoseUnknowns>& starts) {
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t i = 0; i < starts.size(); ++i)
    order.emplace_back(-explained_area_px2(scene, starts[i].pose(), false), i);
  std::sort(order.begin(), order.end());
  std::vector<PoseUnknowns> sorted;
  for (const auto& place : order) sorted.push_back(starts[place.second]);
  return sorted;
}

}  // namespace

bool shows_bands_in_order(const Scene& scene, const Blob& blob, const Rigid3& camera_from_rcm) {
  if (!(camera_from_rcm.translation.norm() > 1e-3)) return false;
  const std::vector<Place> places = places_of(scene, blob, RaysFromRcm(camera_from_rcm));
  const auto fan = fan_over(places);
  return fan && fraction_in_order(scene, *fan, places) >= least_in_order;
}

std::vector<PoseUnknowns> starts_through_rcm(const Scene& scene, const Blob& blob, const Rigid3& camera_from_rcm) {
  if (!(camera_from_rcm.translation.norm() > 1e-3)) return {};
  const RaysFromRcm rays(camera_from_rcm);
  const auto fan = fan_over(places_of(scene, blob, rays));
  if (!fan) return {};
  auto starts = starts_on_lines(scene, rays, *fan, camera_from_rcm);
  if (scene.others.empty()) return starts;
  Scene alone = scene;
  alone.others = {};
  const auto more = starts_on_lines(alone, rays, *fan, camera_from_rcm);
  starts.insert(starts.end(), more.begin(), more.end());
  return best_first(scene, starts);
}

}  // namespace lapservo::internal
