#include "lapservo/vision/decision/verification.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/shaft/sampled_surface.h"

namespace lapservo::internal {
namespace {

constexpr const ValidationLimits& limits = validation_limits;

// Without a well known RCM both ends are needed: they fix the depth, and with it everything else.
bool shows_enough(const Scene& scene, const ColourAgreement& agreement, const FineFit& fit) {
  const int on_inner = fit.used[1] + fit.used[2];
  const int on_ends =
      fit.unknowns.through_rcm() && scene.knows_rcm() ? fit.used[0] + fit.used[3] : std::min(fit.used[0], fit.used[3]);
  return agreement.matching >= limits.min_matching && std::min(on_inner, on_ends) >= limits.min_lines;
}

bool agrees_well(const FineFit& fit) {
  const double enough_sides = limits.enough_of_sides * fit.sides_in_image;
  const double sides = fit.sides_used < enough_sides ? fit.sides_used / enough_sides : 1;
  return fit.inlier_rms_sigmas <= limits.max_rms_sigmas * std::sqrt(fit.located_fraction()) * sides;
}

// The print's fault, not the scene's: a boundary is not where it should be on lines on which nothing hides it.
bool misses_a_boundary(const Scene& scene, const FineFit& fit) {
  for (std::size_t k = 0; k < 4; ++k) {
    if (fit.used[k] >= limits.missed_fraction * fit.in_image[k]) continue;
    const int clear = lines_in_clear_view(scene, fit.unknowns.pose(), k, fit.lines);
    if (clear >= limits.min_lines && fit.used[k] < limits.missed_fraction * clear) return true;
  }
  return false;
}

// Sigma of psi, and the print; psi must hardly ever be wrong, whatever the print is, but for the rig's tolerance.
Status validate_psi(const Scene& scene, const FineFit& fit) {
  const double limit = limits.max_sigma_psi_rad * limits.max_sigma_psi_rad,
               by_tolerance = fit.psi_variance_by_tolerance;
  if (fit.off_probability > limits.certainly_off || (by_tolerance < limit && misses_a_boundary(scene, fit)))
    return fit.is_well_seen() ? Status::marker_mismatch : Status::uncertain;
  const bool is_sure = fit.psi_variance_rad2() < limit + limits.tolerance_slack * by_tolerance;
  const bool is_right = fit.p_false < scene.max_p_false + limits.tolerance_slack * fit.p_false_by_tolerance;
  return is_sure && is_right ? Status::ok : Status::uncertain;
}

using Residuals = InplaceVector<double, EdgeMeasurements::max_lines>;

bool is_doubtful(const FineFit& fit, std::size_t boundary) {
  return fit.used[boundary] < fine_fit_limits.well_seen_fraction * fit.lines;
}

// The largest number of residuals that lie about one of them.
int most_alike(const Residuals& residuals_px) {
  std::ptrdiff_t most = 0;
  for (const double middle_px : residuals_px)
    most = std::max(most, std::count_if(residuals_px.begin(), residuals_px.end(), [&](double residual_px) {
                      return std::abs(residual_px - middle_px) < displaced_limits.alike_px;
                    }));
  return static_cast<int>(most);
}

// `bias_px`: by how much the camera's processing may have moved it.
bool shows_elsewhere(const EdgeMeasurements& edges, std::size_t boundary, double bias_px, double tolerance_m) {
  Residuals elsewhere_px;
  int agreeing = 0;
  for (const Measurement& m : edges.all) {
    if (m.group != boundary) continue;
    const double sigma_px = std::hypot(m.sigma_px, tolerance_m * m.along_px_per_m);
    if (std::abs(m.residual_px) <
        bias_px + std::max(displaced_limits.agreeing_px, displaced_limits.agreeing_sigmas * sigma_px))
      ++agreeing;
    else if (m.sigma_px < displaced_limits.max_sigma_px)
      elsewhere_px.push_back(m.residual_px);
  }
  return most_alike(elsewhere_px) >= std::max(displaced_limits.min_lines, agreeing + 1);
}

}  // namespace

int lines_in_clear_view(const Scene& scene, const ShaftPose& pose, std::size_t boundary, int lines) {
  constexpr double beside_px = 4;
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return 0;
  int count = 0;
  for (int i = 0; i < lines; ++i) {
    const double azimuth_rad = visible_azimuth_rad(*view, edge_limits.line_reach, i, lines);
    const double tau_rad = marker_azimuth_rad(scene.marker, azimuth_rad, pose.psi_rad);
    const double along_m = boundaries_m(scene.marker, tau_rad)[boundary];
    const Eigen::Vector3d point = point_on(pose, scene.marker, azimuth_rad, along_m);
    const Eigen::Vector3d apart = 2 * beside_px / px_per_m_along(scene.camera, pose, point) * axis_of(pose);
    const LineInImage<2> sides(scene, point - apart, apart);
    const auto is_ours = [&](std::size_t side) { return scene.is_ours(sides.class_on_shaft(side)); };
    count += (boundary == 0 || is_ours(0)) && (boundary == 3 || is_ours(1));
  }
  return count;
}

ColourAgreement colour_agreement(const Scene& scene, const ShaftPose& pose, const EdgeBlur& blur) {
  constexpr double length_beyond = 0.04, blurs_beyond = 2;
  // About boundaries and the seam colours mix: at least this fraction of the length.
  constexpr double min_guard = 0.02;
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return {};
  const double length_m = scene.marker.length_m();
  const Eigen::Vector3d middle = point_on(pose, scene.marker, view->facing_azimuth_rad, length_m / 2);
  const double px_per_m = px_per_m_along(scene.camera, pose, middle);
  const double guard_m = std::max(min_guard * length_m, edge_limits.seam_px / px_per_m);
  const std::array blurred_m{std::max(guard_m, blurs_beyond * blur.along_px[0] / px_per_m),
                             std::max(guard_m, blurs_beyond * blur.along_px[3] / px_per_m)};
  const SampledSurface<surface_places> surface(scene, pose, *view,
                                               std::max(blurred_m[0], blurred_m[1]) + length_beyond * length_m);
  ColourAgreement agreement;
  double total = 0, inside = 0;
  std::array<double, 2> beyond{}, going_on{};  // of both ends
  for (const auto& line : surface.lines) {
    const double tau_rad = marker_azimuth_rad(scene.marker, line.azimuth_rad, pose.psi_rad);
    const auto ends_m = boundaries_m(scene.marker, tau_rad);
    if (distance_to_seam_rad(scene.marker, tau_rad) * scene.marker.radius_m() < guard_m) continue;
    for (std::size_t sample = 0; sample < line.classes.size(); ++sample) {
      const double along_m = surface.along_m(sample);
      const std::uint8_t colour = line.classes[sample];
      const auto* const next = std::upper_bound(ends_m.begin(), ends_m.end(), along_m);
      if (next == ends_m.begin() || next == ends_m.end()) {
        const std::size_t end = next == ends_m.end();
        const double away_m = std::abs(along_m - ends_m[3 * end]) - blurred_m[end];
        if (away_m < 0 || away_m > length_beyond * length_m) continue;
        beyond[end] += colour != Scene::outside, going_on[end] += colour == scene.bands[2 * end];
      } else if (std::min(along_m - next[-1], *next - along_m) >= guard_m) {
        const bool match = colour == scene.bands[static_cast<std::size_t>(next - ends_m.begin() - 1)];
        ++total, inside += colour != Scene::outside;
        agreement.matching += match, agreement.wrong += scene.is_ours(colour) && !match;
      }
    }
  }
  for (double* const part : {&agreement.matching, &agreement.wrong}) *part /= std::max(1.0, inside);
  for (const std::size_t end : {0U, 1U})
    agreement.beyond = std::max(agreement.beyond, going_on[end] / std::max(1.0, beyond[end]));
  agreement.in_image = inside / std::max(1.0, total);
  return agreement;
}

Status validate(const Scene& scene, const FineFit& fit) {
  if (!fit.converged) return Status::poor_fit;
  const ColourAgreement agreement = colour_agreement(scene, fit.unknowns.pose(), fit.blur);
  const bool is_cut = agreement.in_image < limits.wholly_in_image && scene.others.empty();
  if (!shows_enough(scene, agreement, fit)) return is_cut ? Status::cut : Status::occluded;
  if (agreement.wrong > limits.max_wrong || agreement.beyond > limits.max_beyond || !agrees_well(fit))
    return Status::poor_fit;
  const bool is_held = fit.unknowns.through_rcm();
  if (scene.registration && (is_held ? fit.misses_rcm : !fit.is_well_seen())) return Status::uncertain;
  return validate_psi(scene, fit);
}

bool may_be_displaced(const FineFit& fit) {
  return is_doubtful(fit, 1) || is_doubtful(fit, 2);
}

bool is_displaced(const Scene& scene, const LightImage& light, const FineFit& fit) {
  constexpr Effort farther{8, 0, 3, 1};
  const DepartedLight seen(light, fit.departure);
  const EdgeMeasurements edges = measure_edges(scene, seen.light(), fit.unknowns, film_mean_m, farther, fit.blur);
  for (const std::size_t boundary : {1U, 2U})
    if (is_doubtful(fit, boundary) &&
        shows_elsewhere(edges, boundary, fit.bias_px[boundary], scene.marker.boundary_sigma_m()))
      return true;
  return false;
}

}  // namespace lapservo::internal
