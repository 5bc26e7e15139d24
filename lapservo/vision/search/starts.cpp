#include "lapservo/vision/search/starts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include <Eigen/Eigenvalues>

#include "lapservo/core/angles.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/marker/band_shares.h"
#include "lapservo/vision/search/coarse_fit.h"
#include "lapservo/vision/search/line_segmentation.h"

namespace lapservo::internal {
namespace {

constexpr double least_sine = 0.05;  // of the angle from the pole: lines fan out
constexpr double few = 0.25;         // of samples or lines, which may show what most do not
constexpr std::size_t line_count = 32, few_lines = 12, line_samples = 112, most_starts = 3;

// Rays of the camera by their angles: alpha about a pole, beta from it. The pole is the direction to a point that the
// shaft's axis passes through on its proximal side, so the axis lies on one alpha, with beta growing towards its tip.
struct RaysFromPole {
  Eigen::Vector3d pole, first = pole.unitOrthogonal(), second = pole.cross(first);

  double alpha_rad(const Eigen::Vector3d& ray) const { return std::atan2(ray.dot(second), ray.dot(first)); }
  double beta_rad(const Eigen::Vector3d& ray) const {
    return std::acos(std::clamp(ray.normalized().dot(pole), -1.0, 1.0));
  }
  Eigen::Vector3d across(double alpha_rad) const { return std::cos(alpha_rad) * first + std::sin(alpha_rad) * second; }
  Eigen::Vector3d ray(double alpha_rad, double beta_rad) const {
    return std::cos(beta_rad) * pole + std::sin(beta_rad) * across(alpha_rad);
  }
};

// Lines side by side that one shaft may show on.
struct Window {
  std::size_t middle = 0, first = 0, last = 0;  // lines
  double score = 0;
};

// The part of the rays that a blob lies in, split into lines from the pole.
struct Fan {
  RaysFromPole rays;
  double first_alpha_rad, step_alpha_rad, first_beta_rad, step_beta_rad;
  std::vector<LineSegmentation> lines{};
  std::vector<Window> windows{};  // best first
  double alpha_rad(double line) const { return first_alpha_rad + line * step_alpha_rad; }
  double beta_rad(double sample) const { return first_beta_rad + sample * step_beta_rad; }
};

// By band, the cosines of its samples' betas.
using BandCosines = std::array<std::vector<double>, 3>;

// Whether the middle band and another one show, as the inner boundaries show psi, and no band lies wholly on the wrong
// side of its neighbour, as in another marker's order. A blob of several markers may have all orders.
bool may_be_in_order(BandCosines& bands) {
  constexpr std::size_t min_samples = 2;
  const auto shows = [&](std::size_t band) { return bands[band].size() >= min_samples; };
  const auto is_contradicted = [&](std::size_t band) {
    return shows(band) && shows(band + 1) && quantile(bands[band], 1 - few) < quantile(bands[band + 1], few);
  };
  return shows(1) && (shows(0) || shows(2)) && !is_contradicted(0) && !is_contradicted(1);
}

// Over a blob's samples of the marker's colours, and as far beyond them as they are apart. Nullopt where they lie in
// another order, or on all sides of the pole: the shaft points at the camera.
std::optional<Fan> fan_over(const Scene& scene, const Blob& blob, const RaysFromPole& rays, std::size_t lines) {
  std::optional<double> alpha_rad;  // of the first sample
  Eigen::Vector3d ahead = Eigen::Vector3d::Zero(), aside = ahead;
  double least_tangent = HUGE_VAL, most_tangent = -HUGE_VAL, least_cosine = 1, most_cosine = -1;
  BandCosines bands;
  for (const Blob::Sample& sample : blob.samples) {
    const auto band = std::find(scene.bands.begin(), scene.bands.end(), sample.colour);
    if (band == scene.bands.end()) continue;
    const auto ideal_px = scene.camera.ideal_from_raw(Eigen::Vector2d(sample.u, sample.v));
    if (!ideal_px) continue;
    const Eigen::Vector3d ray = scene.camera.ray_from_ideal(*ideal_px).normalized();
    if (!alpha_rad) {
      alpha_rad = rays.alpha_rad(ray);
      ahead = rays.across(*alpha_rad), aside = rays.pole.cross(ahead);
    }
    if (!(ray.dot(ahead) > 0)) return std::nullopt;
    const double tangent = ray.dot(aside) / ray.dot(ahead), cosine = ray.dot(rays.pole);
    least_tangent = std::min(least_tangent, tangent), most_tangent = std::max(most_tangent, tangent);
    least_cosine = std::min(least_cosine, cosine), most_cosine = std::max(most_cosine, cosine);
    bands[static_cast<std::size_t>(band - scene.bands.begin())].push_back(cosine);
  }
  if (!may_be_in_order(bands)) return std::nullopt;
  const double first_beta = std::acos(std::min(1.0, most_cosine)), last_beta = std::acos(std::max(-1.0, least_cosine));
  const double alpha_margin_rad =
      blob_grid_px / scene.camera.fx_px / std::max(least_sine, std::sin((first_beta + last_beta) / 2));
  const double beta_margin_rad = 0.2 * (last_beta - first_beta) + 0.01;
  const double first_alpha_rad = *alpha_rad + std::atan(least_tangent) - alpha_margin_rad;
  const double last_alpha_rad = *alpha_rad + std::atan(most_tangent) + alpha_margin_rad;
  const double from_rad = std::max(0.0, first_beta - beta_margin_rad);
  const double to_rad = std::min(pi, last_beta + beta_margin_rad);
  return Fan{rays, first_alpha_rad, (last_alpha_rad - first_alpha_rad) / static_cast<double>(lines - 1), from_rad,
             (to_rad - from_rad) / line_samples};
}

// Cosine and sine of each sample's beta: all lines have the same.
using Samples = std::array<Eigen::Vector2d, line_samples>;

std::uint8_t class_on_ray(const Scene& scene, const Eigen::Vector3d& ray) {
  return scene.field.contains(ray) ? scene.class_beside(scene.camera.raw_from_point(ray)) : Scene::outside;
}

LineSegmentation line_at(const Scene& scene, const RaysFromPole& rays, double alpha_rad, const Samples& samples) {
  const Eigen::Vector3d across = rays.across(alpha_rad);
  std::array<std::uint8_t, line_samples> classes;
  for (std::size_t k = 0; k < line_samples; ++k)
    classes[k] = class_on_ray(scene, samples[k].x() * rays.pole + samples[k].y() * across);
  return segment_line(classes, scene.bands);
}

// As wide as a marker is that looks as long as on the middle line.
Window window_about(const Scene& scene, const Fan& fan, std::size_t middle) {
  Window window{middle};
  const LineSegmentation& line = fan.lines[middle];
  const double length_rad = (line.position[3] - line.position[0]) * fan.step_beta_rad;
  const double beta_rad = fan.beta_rad((line.position[0] + line.position[3]) / 2);
  const double half_rad = 0.8 * scene.marker.radius_m() / scene.marker.length_m() * length_rad;
  const auto half = static_cast<std::size_t>(half_rad / std::max(least_sine, std::sin(beta_rad)) / fan.step_alpha_rad);
  window.first = middle - std::min(middle, half), window.last = std::min(middle + half, fan.lines.size() - 1);
  for (std::size_t i = window.first; i <= window.last; ++i) window.score += fan.lines[i].score;
  return window;
}

double most_score(const std::vector<LineSegmentation>& lines, const Window& window) {
  double most = 0;
  for (std::size_t i = window.first; i <= window.last; ++i) most = std::max(most, lines[i].score);
  return most;
}

constexpr double least_share = 1.0 / 3;  // of the best line's score, for a line that shows the marker

// A foreshortened marker is wider than by its length.
Window grown(Window window, const std::vector<LineSegmentation>& lines) {
  constexpr std::size_t most_apart = 3;
  const double least = least_share * most_score(lines, window);
  for (std::size_t i = window.first; i-- > 0 && window.first - i <= most_apart;)
    if (lines[i].score >= least) window.first = i;
  for (std::size_t i = window.last + 1; i < lines.size() && i - window.last <= most_apart; ++i)
    if (lines[i].score >= least) window.last = i;
  return window;
}

std::vector<Window> best_windows(const Scene& scene, const Fan& fan) {
  constexpr double least = 0.3;  // of the best
  std::vector<Window> all, best;
  for (std::size_t i = 0; i < fan.lines.size(); ++i)
    if (fan.lines[i].score > 0) all.push_back(window_about(scene, fan, i));
  std::sort(all.begin(), all.end(), [](const Window& a, const Window& b) { return a.score > b.score; });
  for (const Window& window : all) {
    if (best.size() == most_starts || window.score < least * all[0].score) break;
    const auto has = [line = window.middle](const Window& other) { return line >= other.first && line <= other.last; };
    if (std::ranges::none_of(best, has)) best.push_back(grown(window, fan.lines));
  }
  return best;
}

// A window's view of the marker.
struct Extent {
  RaysFromPole rays;
  double alpha_rad, width_rad;
  std::optional<double> first_beta_rad, last_beta_rad;
  std::optional<double> only_side_rad{};  // alpha of the side that shows where the other one is hidden, and in
  double away_from_side = 0;              // which direction of alpha the axis lies
  double sine_of_beta = 1;
  bool other_bands = false;  // most lines show bands that the marker has at no azimuth
};

std::optional<BandShares> shares_of(const LineSegmentation& split) {
  if (!std::all_of(split.seen.begin(), split.seen.end(), [](bool seen) { return seen; })) return std::nullopt;
  BandShares shares{};
  for (std::size_t i = 0; i < shares.size(); ++i)
    shares[i] = (split.position[i + 1] - split.position[i]) / (split.position[3] - split.position[0]);
  return shares;
}

// Whether nothing shows beside a line of the fan, by the image's border or another instrument, on most places from
// first to last.
bool is_hidden(const Scene& scene, const RaysFromPole& rays, double alpha_rad, double first_beta_rad,
               double last_beta_rad) {
  constexpr int places = 5;
  int hidden = 0;
  for (int i = 0; i < places; ++i) {
    const double beta_rad = first_beta_rad + (last_beta_rad - first_beta_rad) * (i + 0.5) / places;
    hidden += class_on_ray(scene, rays.ray(alpha_rad, beta_rad)) == Scene::outside;
  }
  return 2 * hidden > places;
}

Extent extent_of(const Scene& scene, const Fan& fan, const Window& window) {
  const std::vector<LineSegmentation>& lines = fan.lines;
  const double most = most_score(lines, window);
  std::vector<double> first, last;
  double sum = 0, lowest = static_cast<double>(lines.size()), highest = 0;
  int count = 0, with_other_bands = 0;
  for (std::size_t i = window.first; i <= window.last; ++i) {
    if (lines[i].score < least_share * most) continue;
    const auto place = static_cast<double>(i);
    sum += place, ++count, lowest = std::min(lowest, place), highest = std::max(highest, place);
    const auto shares = shares_of(lines[i]);
    with_other_bands += shares && !has_band_shares(scene.marker, *shares);
    if (lines[i].seen[0]) first.push_back(fan.beta_rad(lines[i].position[0]));
    if (lines[i].seen[3]) last.push_back(fan.beta_rad(lines[i].position[3]));
  }
  const auto agreed_end = [](std::vector<double>& places) {  // of two lines or more that show it
    return places.size() < 2 ? std::nullopt : std::optional(median(places));
  };
  Extent extent{fan.rays, fan.alpha_rad(sum / count), 0, agreed_end(first), agreed_end(last)};
  extent.other_bands = with_other_bands > (1 - few) * count;
  const LineSegmentation& middle = lines[window.middle];
  const double from_rad = fan.beta_rad(middle.position[0]), to_rad = fan.beta_rad(middle.position[3]);
  extent.sine_of_beta = std::sin((from_rad + to_rad) / 2);
  extent.width_rad = (highest - lowest + 1) * fan.step_alpha_rad * extent.sine_of_beta;
  const double low_rad = fan.alpha_rad(lowest - 1), high_rad = fan.alpha_rad(highest + 1);
  const bool low_hidden = is_hidden(scene, fan.rays, low_rad, from_rad, to_rad);
  if (low_hidden == is_hidden(scene, fan.rays, high_rad, from_rad, to_rad)) return extent;
  extent.only_side_rad = low_hidden ? high_rad : low_rad, extent.away_from_side = low_hidden ? -1 : 1;
  return extent;
}

// How far away the axis is, by the width that the marker shows.
double distance_by_width_m(const Scene& scene, const Extent& extent) {
  const double inset_rad = coarse_fit_limits.contour_inset_px / scene.camera.fx_px;
  return scene.marker.radius_m() / std::sin(std::min(1.0, extent.width_rad / 2 + inset_rad));
}

// The alpha of the axis at a distance from the camera.
double alpha_of_axis(const Scene& scene, const Extent& extent, double distance_m) {
  if (!extent.only_side_rad) return extent.alpha_rad;
  return *extent.only_side_rad +
         extent.away_from_side * scene.marker.radius_m() / (distance_m * std::max(least_sine, extent.sine_of_beta));
}

// How far away the proximal end of a shaft through the RCM is, by the length that the marker shows; by its width where
// the length does not show it.
double distance_of(const Scene& scene, const Extent& extent, double first_beta_rad, double rcm_m) {
  constexpr int steps = 120;
  constexpr double nearest_m = 0.03, farthest_m = 0.4, sigma_rad = 0.005, sigma_log = 0.3;
  const double by_width_m = distance_by_width_m(scene, extent);
  if (!extent.first_beta_rad || !extent.last_beta_rad) return by_width_m;
  const Eigen::Vector3d rcm = rcm_m * extent.rays.pole;
  double least = HUGE_VAL, best_m = by_width_m;
  for (int i = 0; i <= steps; ++i) {
    const double distance_m = nearest_m * std::pow(farthest_m / nearest_m, 1.0 * i / steps);
    const Eigen::Vector3d proximal = distance_m * extent.rays.ray(extent.alpha_rad, first_beta_rad);
    const Eigen::Vector3d distal = proximal + scene.marker.length_m() * (proximal - rcm).normalized();
    const double cost = std::pow((extent.rays.beta_rad(distal) - *extent.last_beta_rad) / sigma_rad, 2) +
                        std::pow(std::log(distance_m / by_width_m) / sigma_log, 2);
    if (cost < least) least = cost, best_m = distance_m;
  }
  return best_m;
}

std::optional<PoseUnknowns> start_through_rcm(const Scene& scene, const Extent& extent, const Rigid3& camera_from_rcm) {
  const double shown_rad = scene.marker.length_m() / distance_by_width_m(scene, extent);  // seen squarely
  const double first_beta_rad = extent.first_beta_rad ? *extent.first_beta_rad : *extent.last_beta_rad - shown_rad;
  const double distance_m = distance_of(scene, extent, first_beta_rad, camera_from_rcm.translation.norm());
  const double alpha_rad = alpha_of_axis(scene, extent, distance_m);
  const auto q = configuration_through(camera_from_rcm, distance_m * extent.rays.ray(alpha_rad, first_beta_rad));
  return q ? std::optional(PoseUnknowns(pose_through_rcm(camera_from_rcm, *q), true)) : std::nullopt;
}

// At a distance of the axis, the foreshortening leaves two poses, tip towards or away from the camera, or one where
// there is none.
void add_free_starts(const Scene& scene, const Extent& extent, double distance_m, std::vector<PoseUnknowns>& starts) {
  constexpr double least_tilt_rad = 0.05;
  const double length_m = scene.marker.length_m(), alpha_rad = alpha_of_axis(scene, extent, distance_m);
  const double shown_rad = length_m / distance_m;  // seen squarely
  const double first_beta_rad = extent.first_beta_rad.value_or(*extent.last_beta_rad - shown_rad);
  const double last_beta_rad = extent.last_beta_rad.value_or(first_beta_rad + shown_rad);
  const double tilt_rad = std::acos(std::clamp((last_beta_rad - first_beta_rad) / shown_rad, 0.0, 1.0));
  const Eigen::Vector3d sight = extent.rays.ray(alpha_rad, (first_beta_rad + last_beta_rad) / 2);
  const Eigen::Vector3d across_sight = (sight * sight.dot(extent.rays.pole) - extent.rays.pole).normalized();
  for (const double sign : {1.0, -1.0}) {
    const Eigen::Vector3d axis = std::cos(tilt_rad) * across_sight + sign * std::sin(tilt_rad) * sight;
    const Eigen::Vector3d proximal =
        (distance_m - sign * std::sin(tilt_rad) * length_m / 2) * extent.rays.ray(alpha_rad, first_beta_rad);
    starts.push_back(PoseUnknowns({{rotation_between(Eigen::Vector3d::UnitZ(), axis), proximal}, 0}, false));
    if (tilt_rad < least_tilt_rad) break;
  }
}

std::optional<Fan> split_fan(const Scene& scene, const Blob& blob, const Eigen::Vector3d& pole,
                             std::size_t lines = line_count) {
  auto fan = fan_over(scene, blob, RaysFromPole{pole}, lines);
  if (!fan) return std::nullopt;
  Samples samples;
  for (std::size_t k = 0; k < line_samples; ++k) {
    const double beta_rad = fan->beta_rad(static_cast<double>(k) + 0.5);
    samples[k] = {std::cos(beta_rad), std::sin(beta_rad)};
  }
  for (std::size_t i = 0; i < lines; ++i)
    fan->lines.push_back(line_at(scene, fan->rays, fan->alpha_rad(static_cast<double>(i)), samples));
  fan->windows = best_windows(scene, *fan);
  return fan;
}

// The pole of lines along the shaft by a fan of lines that are nearly: a marker's ends are square to its axis.
Eigen::Vector3d turned_pole(const Fan& fan) {
  constexpr std::size_t least_apart = 2;
  const Window& window = fan.windows.front();
  std::vector<double> slopes;
  for (const std::size_t end : {0, 3})
    for (std::size_t i = window.first; i <= window.last; ++i)
      for (std::size_t j = i + least_apart; j <= window.last; ++j) {
        const LineSegmentation &a = fan.lines[i], &b = fan.lines[j];
        if (a.seen[end] && b.seen[end])
          slopes.push_back((b.position[end] - a.position[end]) / static_cast<double>(j - i));
      }
  if (slopes.empty()) return fan.rays.pole;
  const double turn_rad = std::atan(median(slopes) * fan.step_beta_rad / fan.step_alpha_rad);
  const Eigen::Vector3d aside = fan.rays.across(fan.alpha_rad(static_cast<double>(window.middle)) + pi / 2);
  return std::cos(turn_rad) * fan.rays.pole + std::sin(turn_rad) * aside;
}

// Where a blob spreads most, across the line of sight; nullopt where it shows nothing of the marker's colours.
std::optional<Eigen::Vector3d> long_direction(const Scene& scene, const Blob& blob) {
  std::vector<Eigen::Vector3d> rays;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Blob::Sample& sample : blob.samples) {
    const auto ideal_px = scene.camera.ideal_from_raw(Eigen::Vector2d(sample.u, sample.v));
    if (!scene.is_ours(sample.colour) || !ideal_px) continue;
    rays.push_back(scene.camera.ray_from_ideal(*ideal_px).normalized());
    sum += rays.back();
  }
  if (rays.empty()) return std::nullopt;
  const Eigen::Vector3d middle = sum / static_cast<double>(rays.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& ray : rays) scatter += (ray - middle) * (ray - middle).transpose();
  const Eigen::Vector3d direction =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>().computeDirect(scatter).eigenvectors().col(2);
  return (direction - direction.dot(middle) / middle.squaredNorm() * middle).normalized();
}

void add_extents(const Scene& scene, const Fan& fan, std::vector<Extent>& extents) {
  for (const Window& window : fan.windows) {
    const Extent extent = extent_of(scene, fan, window);
    if (extent.first_beta_rad || extent.last_beta_rad) extents.push_back(extent);
  }
}

void add_extents(const Scene& scene, const Blob& blob, const std::optional<Rigid3>& camera_from_rcm,
                 std::vector<Extent>& extents) {
  if (camera_from_rcm) {
    if (!(camera_from_rcm->translation.norm() > LensField::nearest_m)) return;
    if (const auto fan = split_fan(scene, blob, camera_from_rcm->translation.normalized()))
      add_extents(scene, *fan, extents);
    return;
  }
  const auto direction = long_direction(scene, blob);
  if (!direction) return;
  for (const Eigen::Vector3d& pole : {*direction, Eigen::Vector3d(-*direction)}) {
    auto fan = split_fan(scene, blob, pole, few_lines);
    if (fan && !fan->windows.empty()) fan = split_fan(scene, blob, turned_pole(*fan));
    if (fan) add_extents(scene, *fan, extents);
  }
}

}  // namespace

Starts starts_in(const Scene& scene, const Blob& blob, const std::optional<Rigid3>& camera_from_rcm) {
  std::vector<Extent> extents;
  add_extents(scene, blob, camera_from_rcm, extents);
  if (!scene.others.empty()) {
    Scene alone = scene;
    alone.others = {};
    add_extents(alone, blob, camera_from_rcm, extents);
  }
  Starts starts;
  for (const Extent& extent : extents) {
    starts.other_bands |= extent.other_bands;
    if (camera_from_rcm)
      if (auto start = start_through_rcm(scene, extent, *camera_from_rcm)) starts.poses.push_back(*start);
  }
  if (camera_from_rcm) return starts;
  for (const double scale : {1.0, nearer_scale}) {
    starts.rivals = starts.poses.size();
    for (const Extent& extent : extents)
      add_free_starts(scene, extent, scale * distance_by_width_m(scene, extent), starts.poses);
  }
  return starts;
}

}  // namespace lapservo::internal
