#include "lapservo/vision/decision/verification.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"

namespace lapservo::internal {
namespace {

constexpr const ValidationLimits& limits = validation_limits;

double squared(double x) {
  return x * x;
}

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

// Whether psi is hardly ever wrong, whatever the print is; what the rig's tolerance makes of it does not count.
bool has_right_psi(const Scene& scene, const FineFit& fit) {
  return fit.p_false < scene.max_p_false + limits.tolerance_slack * fit.p_false_by_tolerance;
}

// Sigma of psi, and the print.
Status validate_psi(const Scene& scene, const FineFit& fit) {
  const double limit = squared(limits.max_sigma_psi_rad), by_tolerance = fit.psi_variance_by_tolerance;
  if (fit.off_probability > limits.certainly_off || (by_tolerance < limit && misses_a_boundary(scene, fit)))
    return fit.is_well_seen() ? Status::marker_mismatch : Status::uncertain;
  const bool is_sure = fit.psi_variance_rad2() < limit + limits.tolerance_slack * by_tolerance;
  return is_sure && has_right_psi(scene, fit) ? Status::ok : Status::uncertain;
}

}  // namespace

int lines_in_clear_view(const Scene& scene, const ShaftPose& pose, std::size_t boundary, int lines) {
  constexpr double reach = 0.9, beside_px = 4;
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return 0;
  const Eigen::Vector3d axis = pose.camera_from_unrolled.rotation * Eigen::Vector3d::UnitZ();
  int count = 0;
  for (int i = 0; i < lines; ++i) {
    const double azimuth_rad = visible_azimuth_rad(*view, reach, i, lines);
    const double tau_rad = marker_azimuth_rad(scene.marker, azimuth_rad, pose.psi_rad);
    const double along_m = boundaries_m(scene.marker, tau_rad)[boundary];
    const Eigen::Vector3d point =
        pose.camera_from_unrolled * surface_point(scene.marker.radius_m(), azimuth_rad, along_m);
    const double px_per_m = (scene.camera.raw_with_jacobian(point).d_px_d_point * axis).norm();
    const Eigen::Vector3d beside = beside_px / px_per_m * axis;
    count += (boundary == 0 || scene.is_ours(scene.class_on_shaft(point - beside))) &&
             (boundary == 3 || scene.is_ours(scene.class_on_shaft(point + beside)));
  }
  return count;
}

ColourAgreement colour_agreement(const Scene& scene, const ShaftPose& pose, const EdgeBlur& blur) {
  constexpr int azimuths = 13, places = 40, places_beyond = 4;
  constexpr double length_beyond = 0.04, blurs_beyond = 2;
  // About boundaries colours mix: so far, and at least this fraction of the length.
  constexpr double reach = 0.8, blurred_px = 1.5, min_guard = 0.02;
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return {};
  const double length_m = scene.marker.length_m();
  const Eigen::Vector3d axis = pose.camera_from_unrolled.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d middle =
      pose.camera_from_unrolled * surface_point(scene.marker.radius_m(), view->facing_azimuth_rad, length_m / 2);
  const double px_per_m = (scene.camera.raw_with_jacobian(middle).d_px_d_point * axis).norm();
  const double guard_m = std::max(min_guard * length_m, blurred_px / px_per_m);
  int total = 0, inside = 0, matching = 0, wrong = 0;
  std::array<int, 2> beyond{}, going_on{};  // of both ends
  for (int i = 0; i < azimuths; ++i) {
    const double azimuth_rad = visible_azimuth_rad(*view, reach, i, azimuths);
    const double tau_rad = marker_azimuth_rad(scene.marker, azimuth_rad, pose.psi_rad);
    if (scene.marker.gap_rad > 0 && distance_to_seam_rad(scene.marker, tau_rad) * scene.marker.radius_m() < guard_m)
      continue;
    const auto ends_m = boundaries_m(scene.marker, tau_rad);
    const Eigen::Vector3d base = pose.camera_from_unrolled * surface_point(scene.marker.radius_m(), azimuth_rad, 0);
    for (const std::size_t end : {0U, 1U})
      for (int k = 0; k < places_beyond; ++k) {
        const double blurred_m = blurs_beyond * blur.along_px[3 * end] / px_per_m;
        const double away_m = std::max(guard_m, blurred_m) + length_beyond * length_m * (k + 0.5) / places_beyond;
        const std::uint8_t colour =
            scene.class_on_shaft(base + (end == 0 ? ends_m[0] - away_m : ends_m[3] + away_m) * axis);
        beyond[end] += colour != Scene::outside, going_on[end] += colour == scene.bands[2 * end];
      }
    for (int k = 0; k < places; ++k) {
      const double along_m = length_m * (k + 0.5) / places;
      const auto is_near = [&](double end_m) { return std::abs(end_m - along_m) < guard_m; };
      if (std::any_of(ends_m.begin(), ends_m.end(), is_near)) continue;
      ++total;
      const std::size_t band = along_m < ends_m[1] ? 0 : along_m < ends_m[2] ? 1 : 2;
      const std::uint8_t colour = scene.class_on_shaft(base + along_m * axis);
      if (colour == Scene::outside) continue;
      const bool match = colour == scene.bands[band];
      ++inside, matching += match, wrong += scene.is_ours(colour) && !match;
    }
  }
  const auto fraction = [](int part, int whole) { return whole ? static_cast<double>(part) / whole : 0; };
  return {fraction(matching, inside), fraction(wrong, inside),
          std::max(fraction(going_on[0], beyond[0]), fraction(going_on[1], beyond[1])), fraction(inside, total)};
}

Status validate(const Scene& scene, const FineFit& fit) {
  if (!fit.converged) return Status::poor_fit;
  const ColourAgreement agreement = colour_agreement(scene, fit.unknowns.pose(), fit.blur);
  const bool is_cut = agreement.in_image < limits.wholly_in_image && scene.others.empty();
  if (!shows_enough(scene, agreement, fit)) return is_cut ? Status::cut : Status::occluded;
  if (agreement.wrong > limits.max_wrong || agreement.beyond > limits.max_beyond || !agrees_well(fit))
    return Status::poor_fit;
  if (scene.registration && !fit.unknowns.through_rcm() && !fit.is_well_seen()) return Status::uncertain;
  return validate_psi(scene, fit);
}

}  // namespace lapservo::internal
