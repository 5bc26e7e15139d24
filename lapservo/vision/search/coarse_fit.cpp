#include "lapservo/vision/search/coarse_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include "lapservo/core/angles.h"
#include "lapservo/core/inplace_vector.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/colour/colour_evidence.h"
#include "lapservo/vision/model/normal_equations.h"
#include "lapservo/vision/search/line_segmentation.h"
#include "lapservo/vision/shaft/sampled_surface.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t samples_along = 128;
using Surface = SampledSurface<samples_along>;
constexpr int line_count = surface_lines, station_count = 15;
// Samples on each side of a section's middle, at most: of half the shaft, and of all.
constexpr int half_samples = 40, max_reach = half_samples + static_cast<int>(coarse_fit_limits.lateral_reach_px);
constexpr double max_hidden = 0.8;  // of a section of the shaft: what the image's border leaves must have a side

// Measured image points that lie on the marker's outline or boundaries, attached to where they belong on its surface.
struct SidePoint {
  Eigen::Vector2d raw_px;
  double side;  // -1, +1: silhouette at gamma + side * half_visible
  double along_m;
};
struct BoundaryPoint {
  Eigen::Vector2d raw_px;
  double azimuth_rad;
  std::size_t boundary;
};

using SidePoints = InplaceVector<SidePoint, 2 * station_count>;
using BoundaryPoints = InplaceVector<BoundaryPoint, 4 * line_count>;

// Neighbouring samples of a section, first to last; none when last < first.
struct Stretch {
  int first = 0, last = -1;
  float sum = 0;
};

// With the most marker colour in it (maximum subarray).
Stretch most_colourful_stretch(std::span<const std::uint8_t> classes, const Scene& scene) {
  Stretch best;
  float sum = 0;
  int first = 0;
  for (int i = 0; i < static_cast<int>(classes.size()); ++i) {
    const std::uint8_t colour = classes[static_cast<std::size_t>(i)];
    if (colour != Scene::outside) sum += static_cast<float>(section_gain(scene.is_ours(colour)));
    if (sum <= 0)
      sum = 0, first = i + 1;
    else if (sum > best.sum)
      best = {first, i, sum};
  }
  return best;
}

// Sections across the shaft: where its colours begin and end.
SidePoints measure_sides(const Scene& scene, const ShaftPose& pose, const CylinderView& view, double reach_px) {
  constexpr double margin = 0.04;  // of the length, at either end
  SidePoints points;
  InplaceVector<std::uint8_t, 2 * max_reach + 1> classes;
  for (int station = 0; station < station_count; ++station) {
    const double along_m = scene.marker.length_m() * (margin + (1 - 2 * margin) * station / (station_count - 1));
    const auto silhouette = [&](double side) {
      return scene.camera.raw_from_point(
          point_on(pose, scene.marker, view.facing_azimuth_rad + side * view.half_visible_rad, along_m));
    };
    const Eigen::Vector2d left = silhouette(-1), right = silhouette(1), middle = (left + right) / 2;
    const double half_px = (right - left).norm() / 2;
    if (!(half_px > 2 && std::isfinite(half_px))) continue;
    const Eigen::Vector2d across = (right - left) / (2 * half_px);
    const double step_px = std::max(1.0, half_px / half_samples);
    const int reach = static_cast<int>((half_px + reach_px) / step_px);
    classes.clear();
    double hidden_px = 0;  // of the shaft, beyond the image
    for (int i = -reach; i <= reach; ++i) {
      const std::uint8_t colour = scene.class_beside(middle + i * step_px * across);
      classes.push_back(colour);
      if (colour == Scene::outside && std::abs(i) * step_px < half_px) hidden_px += step_px;
    }
    const Stretch stretch = most_colourful_stretch(classes, scene);
    const double width_px = (stretch.last - stretch.first + 1) * step_px;
    if (hidden_px > max_hidden * 2 * half_px ||
        width_px < coarse_fit_limits.narrowest_section * (2 * half_px - hidden_px) ||
        width_px > coarse_fit_limits.widest_section * 2 * half_px)
      continue;
    const auto add = [&](int inner, int outer, double side) {
      if (outer < 0 || outer >= static_cast<int>(classes.size())) return;
      if (classes[static_cast<std::size_t>(outer)] == Scene::outside) return;
      const double t_px = (inner - reach + 0.5 * side) * step_px + side * coarse_fit_limits.contour_inset_px;
      points.push_back({middle + t_px * across, side, along_m});
    };
    add(stretch.first, stretch.first - 1, -1);
    add(stretch.last, stretch.last + 1, 1);
  }
  return points;
}

BoundaryPoints measure_boundaries(const Scene& scene, const ShaftPose& pose, const Surface& surface) {
  BoundaryPoints points;
  for (const Surface::Line& line : surface.lines) {
    const LineSegmentation split = segment_line(line.classes, scene.bands);
    for (std::size_t k = 0; k < 4; ++k) {
      if (!split.seen[k]) continue;
      const double along_m = surface.first_m + split.position[k] * surface.step_m;
      points.push_back(
          {scene.camera.raw_from_point(point_on(pose, scene.marker, line.azimuth_rad, along_m)), line.azimuth_rad, k});
    }
  }
  return points;
}

// Adds the image distance of a measured point from the curve through `point` with tangent `tangent` (camera frame).
void add_curve_distance(const Scene& scene, const PoseUnknowns& unknowns, const Eigen::Vector3d& point,
                        const Eigen::Vector3d& tangent, double psi_speed_m, const Eigen::Vector2d& measured_px,
                        double sigma_px, NormalEquations& equations) {
  if (!scene.field.contains(point)) return;
  const ProjectionWithJacobian image = scene.camera.raw_with_jacobian(point);
  const Eigen::Vector2d along = (image.d_px_d_point * tangent).normalized();
  const Eigen::Vector2d normal(-along.y(), along.x());
  if (!normal.allFinite()) return;
  const double residual_px = normal.dot(measured_px - image.point_px);
  const Eigen::Vector3d pull = image.d_px_d_point.transpose() * normal;
  UnknownVector row = unknowns.row(point, pull);
  row[psi_unknown] = psi_speed_m * pull.dot(axis_of(unknowns.pose()));
  equations.add(row, residual_px, robust_certainty(residual_px, sigma_px));
}

// One Gauss-Newton step on measured points. Inner boundaries count only once the rotation is known.
std::optional<PoseUnknowns> stepped(const Scene& scene, const PoseUnknowns& unknowns, std::span<const SidePoint> sides,
                                    std::span<const BoundaryPoint> boundaries, bool with_rotation) {
  const ShaftPose& pose = unknowns.pose();
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return std::nullopt;
  const Eigen::Matrix3d axes = pose.camera_from_unrolled.rotation.toRotationMatrix();
  NormalEquations equations;
  for (const SidePoint& side : sides) {
    const double azimuth_rad = view->facing_azimuth_rad + side.side * view->half_visible_rad;
    add_curve_distance(scene, unknowns, point_on(pose, scene.marker, azimuth_rad, side.along_m), axes.col(2), 0,
                       side.raw_px, coarse_fit_limits.side_sigma_px, equations);
  }
  for (const BoundaryPoint& b : boundaries) {
    if ((b.boundary == 1 || b.boundary == 2) && !with_rotation) continue;
    // For a rotation that is not known yet, ends lie in the middle of where they lie over the turn.
    const double tau_rad =
        with_rotation ? marker_azimuth_rad(scene.marker, b.azimuth_rad, pose.psi_rad) : scene.marker.covered_rad() / 2;
    const double along_m = boundaries_m(scene.marker, tau_rad)[b.boundary];
    const double slope_m = with_rotation ? boundary_slopes_m(scene.marker)[b.boundary] : 0;
    const Eigen::Vector3d around = axes * Eigen::Vector3d(-std::sin(b.azimuth_rad), std::cos(b.azimuth_rad), 0);
    const Eigen::Vector3d tangent = scene.marker.radius_m() * around + slope_m * axes.col(2);
    add_curve_distance(scene, unknowns, point_on(pose, scene.marker, b.azimuth_rad, along_m), tangent, -slope_m,
                       b.raw_px, coarse_fit_limits.boundary_sigma_px, equations);
  }
  if (scene.registration && unknowns.through_rcm()) {
    const RcmMeasurement rcm = scene.registration->of(pose, coarse_fit_limits.least_rcm_sigma_m);
    for (const int across : {0, 1}) equations.add(rcm.rows.row(across), rcm.residual[across], 1);
  }
  const PoseUnknowns next = unknowns.changed_by(equations.solve(1e-4).head<pose_unknowns>());
  return next.pose().camera_from_unrolled.translation.allFinite() ? std::optional(next) : std::nullopt;
}

// Agreement of the sampled colours with the marker's at a rotation: matches minus wrong colours, over all colours seen.
class RotationScore {
 public:
  RotationScore(const Scene& scene, const Surface& surface) : scene_(scene), surface_(surface) {
    const auto upper_m = boundaries_m(scene.marker, 0), slopes_m = boundary_slopes_m(scene.marker);
    for (std::size_t k = 0; k < 4; ++k) {
      upper_[k] = surface.samples_before(upper_m[k]) + 0.5;
      slope_[k] = slopes_m[k] / surface.step_m;
    }
    for (std::size_t i = 0; i < line_count; ++i) {
      std::array<int, 3> sums{};
      sums_[i][0] = sums;
      for (std::size_t k = 0; k < samples_along; ++k) {
        const std::uint8_t colour = surface.lines[i].classes[k];
        const bool ours = scene.is_ours(colour);
        for (std::size_t band = 0; band < 3; ++band) sums[band] += 2 * (colour == scene.bands[band]) - ours;
        sums_[i][k + 1] = sums;
        seen_ += ours;
      }
    }
  }

  double at(double psi_rad) const {
    int score = 0;
    for (std::size_t i = 0; i < line_count; ++i) {
      const double tau_rad = wrap_two_pi(marker_azimuth_rad(scene_.marker, surface_.lines[i].azimuth_rad, psi_rad));
      if (!is_printed(scene_.marker, tau_rad)) continue;
      std::array<const std::array<int, 3>*, 4> sums;
      for (std::size_t k = 0; k < 4; ++k) sums[k] = &sums_[i][index(upper_[k] + tau_rad * slope_[k])];
      for (std::size_t band = 0; band < 3; ++band) score += (*sums[band + 1])[band] - (*sums[band])[band];
    }
    return seen_ ? static_cast<double>(score) / seen_ : 0;
  }

 private:
  static std::size_t index(double along_steps) {
    return static_cast<std::size_t>(std::clamp(along_steps, 0.0, static_cast<double>(samples_along)));
  }

  const Scene& scene_;
  const Surface& surface_;
  std::array<double, 4> upper_, slope_;  // of the boundaries, in steps of the surface: at the seam and per radian
  std::array<std::array<std::array<int, 3>, samples_along + 1>, line_count> sums_;  // over samples before, per band
  int seen_ = 0;
};

CoarseFit with_best_rotation(CoarseFit fit, const Scene& scene, const Surface& surface) {
  constexpr int steps = 90, rival_gap = 10;  // 0.7 rad
  const RotationScore score(scene, surface);
  std::array<double, steps> scores{};
  for (int i = 0; i < steps; ++i) scores[static_cast<std::size_t>(i)] = score.at(two_pi * i / steps);
  const int best = static_cast<int>(std::max_element(scores.begin(), scores.end()) - scores.begin());
  fit.unknowns = fit.unknowns.with_psi(two_pi * best / steps);
  fit.rotation_score = scores[static_cast<std::size_t>(best)];
  fit.rival_score = -1;
  for (int i = 0; i < steps; ++i) {
    const int gap = std::abs(i - best);
    if (std::min(gap, steps - gap) > rival_gap)
      fit.rival_score = std::max(fit.rival_score, scores[static_cast<std::size_t>(i)]);
  }
  return fit;
}

}  // namespace

CoarseFit fit_coarsely(const Scene& scene, PoseUnknowns start, Rotation rotation) {
  constexpr int steps_per_round = 4;
  CoarseFit fit;
  fit.unknowns = std::move(start);
  const int last = rotation == Rotation::known ? 0 : 1;
  for (int round = 0; round <= last; ++round) {
    const auto view = view_cylinder(fit.unknowns.pose().camera_from_unrolled, scene.marker.radius_m());
    if (!view) return fit;
    const double narrowing = round == 0 ? 1 : 0.5;
    const auto sides = measure_sides(scene, fit.unknowns.pose(), *view, narrowing * coarse_fit_limits.lateral_reach_px);
    const Surface surface(scene, fit.unknowns.pose(), *view,
                          narrowing * coarse_fit_limits.along_reach * scene.marker.length_m());
    const auto boundaries = measure_boundaries(scene, fit.unknowns.pose(), surface);
    if (boundaries.size() < coarse_fit_limits.min_boundaries || sides.size() < coarse_fit_limits.min_sides) return fit;
    if (round == 1) fit = with_best_rotation(fit, scene, surface);
    for (int step = 0; step < steps_per_round; ++step) {
      const auto next = stepped(scene, fit.unknowns, sides, boundaries, round == last);
      if (!next) return fit;
      fit.unknowns = *next;
    }
  }
  fit.found = true;
  return fit;
}

}  // namespace lapservo::internal
