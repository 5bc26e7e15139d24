#include "lapservo/vision/accept/verification.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/accept/colour_evidence.h"

namespace lapservo::internal {
namespace {

constexpr const ValidationLimits& limits = validation_limits;

double squared(double x) {
  return x * x;
}

// Of the marker; at least a pixel.
double length_in_image_px(const Scene& scene, const ShaftPose& pose, double azimuth_rad) {
  const auto px = [&](double along_m) {
    return scene.camera.raw_from_point(pose.camera_from_unrolled *
                                       surface_point(scene.marker.radius_m(), azimuth_rad, along_m));
  };
  const double length_px = (px(scene.marker.length_m()) - px(0)).norm();
  return std::isfinite(length_px) ? std::max(1.0, length_px) : 1.0;
}

// The print's fault, not the scene's: a boundary is not where it should be on lines on which nothing hides it.
bool misses_a_boundary(const Scene& scene, const FineFit& fit, const ColourAgreement& agreement) {
  if (agreement.matching <= limits.unhidden_matching || fit.blur.boundaries_px() >= limits.unblurred_px) return false;
  for (std::size_t k = 0; k < 4; ++k) {
    if (fit.in_image[k] < limits.enough_lines || fit.used[k] >= limits.missed_fraction * fit.in_image[k]) continue;
    const int clear = lines_in_clear_view(scene, fit.unknowns.pose(), k, fit.lines);
    if (clear >= limits.enough_lines && fit.used[k] < limits.missed_fraction * clear) return true;
  }
  return false;
}

// Of how many of its lines a boundary is located.
double located_of_lines(const FineFit& fit, std::size_t boundary) {
  return static_cast<double>(fit.used[boundary]) / std::max(1, fit.lines);
}

// Whether what shows of three boundaries holds the fourth, an end, as well.
bool needs_no_other_end(const FineFit& fit) {
  return fit.located_fraction() > limits.less_hidden &&
         std::min(located_of_lines(fit, 1), located_of_lines(fit, 2)) > limits.well_located &&
         std::max(located_of_lines(fit, 0), located_of_lines(fit, 3)) > limits.wholly_located;
}

double max_spilled(const FineFit& fit) {
  const bool located = std::min(located_of_lines(fit, 0), located_of_lines(fit, 3)) > limits.half_located;
  return located ? limits.max_spilled_of_located : limits.max_spilled;
}

// A boundary on fewer lines may be the blood's.
int fewest_lines(const FineFit& fit) {
  return std::max(limits.min_of_end, fit.lines / limits.end_one_in);
}

// Another instrument's colours beside a marker that shows as it should are no reason to doubt it.
bool shows_wholly_among_others(const Scene& scene, const ColourAgreement& agreement, const FineFit& fit) {
  return scene.among_others && agreement.matching > limits.matching_among_others &&
         fit.located_fraction() > limits.located_among_others;
}

// Sigma of psi, and the print.
Status validate_psi(const Scene& scene, const FineFit& fit, const ColourAgreement& agreement) {
  const double limit = squared(limits.max_sigma_psi_rad), by_tolerance = fit.psi_variance_by_tolerance;
  if (by_tolerance < limit && misses_a_boundary(scene, fit, agreement)) return Status::marker_mismatch;
  if (fit.off_probability > limits.certainly_off)
    return is_well_seen(fit) ? Status::marker_mismatch : Status::uncertain;
  if (!(fit.psi_variance_rad2() < limit + limits.tolerance_slack * by_tolerance)) return Status::uncertain;
  // Without the RCM a frame shows less of the print.
  if (fit.unknowns.q() && !has_right_psi(scene, fit)) return Status::uncertain;
  return Status::ok;
}

}  // namespace

bool is_well_seen(const FineFit& fit) {
  return fit.located_fraction() > limits.well_seen_fraction;
}

bool has_right_psi(const Scene& scene, const FineFit& fit) {
  return fit.p_false < scene.max_p_false + limits.tolerance_slack * fit.p_false_by_tolerance;
}

bool tells_psi(const FineFit& fit) {
  return fit.psi_variance_rad2() <
         squared(limits.max_sigma_told_rad) + limits.tolerance_slack * fit.psi_variance_by_tolerance;
}

ColourAgreement colour_agreement(const Scene& scene, const ShaftPose& pose) {
  constexpr int azimuths = 13, places = 40, margin = 5;
  constexpr double beside_radii = 1.2;
  ColourAgreement agreement;
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return agreement;
  const double length_m = scene.marker.length_m(), ring_m = 0.1 * length_m;
  const double guard_m =
      length_m *
      std::max(limits.min_guard, limits.blurred_px / length_in_image_px(scene, pose, view->facing_azimuth_rad));
  int total = 0, inside = 0, matching = 0, wrong = 0, outer = 0, beyond = 0, flank = 0, beside = 0;
  std::array<int, 2> ring{}, spilled{};
  const Eigen::Vector3d axis = pose.camera_from_unrolled.rotation * Eigen::Vector3d::UnitZ();
  for (int i = 0; i < azimuths; ++i) {
    const double azimuth_rad = visible_azimuth_rad(*view, 0.8, i, azimuths);
    const double tau_rad = marker_azimuth_rad(scene.marker, azimuth_rad, pose.psi_rad);
    if (scene.marker.gap_rad > 0 && distance_to_seam_rad(scene.marker, tau_rad) * scene.marker.radius_m() < guard_m)
      continue;
    const auto ends_m = boundaries_m(scene.marker, tau_rad);
    const Eigen::Vector3d base = pose.camera_from_unrolled * surface_point(scene.marker.radius_m(), azimuth_rad, 0);
    for (int k = -margin; k < places + margin; ++k) {
      const double along_m = length_m * (k + 0.5) / places;
      bool near_boundary = false;
      int band = 0;
      for (const double end_m : ends_m) near_boundary |= std::abs(end_m - along_m) < guard_m, band += along_m >= end_m;
      if (near_boundary) continue;
      const bool on_marker = band >= 1 && band <= 3;
      total += on_marker;
      const Eigen::Vector3d point = base + along_m * axis;
      const std::uint8_t colour = on_marker ? scene.class_on_shaft(point) : scene.class_at_point(point);
      if (colour == Scene::outside) continue;
      const bool ours = scene.is_ours(colour);
      if (!on_marker) {
        const std::size_t end = band < 1 ? 0 : 1;
        const double past_m = end == 0 ? ends_m[0] - along_m : along_m - ends_m[3];
        if (past_m < ring_m) ++ring[end], spilled[end] += colour == scene.bands[2 * end];
        ++outer, beyond += ours;
        continue;
      }
      ++inside;
      const bool match = colour == scene.bands[static_cast<std::size_t>(band - 1)];
      matching += match, wrong += ours && !match;
    }
  }
  for (const double side : {-1.0, 1.0}) {
    const Eigen::Vector3d base = pose.camera_from_unrolled * surface_point(beside_radii * scene.marker.radius_m(),
                                                                           view->facing_azimuth_rad + side * pi / 2, 0);
    for (int k = 0; k < places; ++k) {
      const std::uint8_t colour = scene.class_at_point(base + length_m * (k + 0.5) / places * axis);
      if (colour != Scene::outside) ++flank, beside += scene.is_ours(colour);
    }
  }
  const auto fraction = [](int part, int whole) { return whole ? static_cast<double>(part) / whole : 0; };
  return {fraction(matching, inside), fraction(wrong, inside),
          fraction(inside, total),    fraction(beyond, outer),
          fraction(beside, flank),    std::max(fraction(spilled[0], ring[0]), fraction(spilled[1], ring[1]))};
}

Status validate(const Scene& scene, const FineFit& fit) {
  if (!fit.converged) return Status::poor_fit;
  const ColourAgreement agreement = colour_agreement(scene, fit.unknowns.pose());
  const bool in_image = agreement.in_image > limits.wholly_in_image;
  const Status too_little = in_image || !scene.others.empty() ? Status::occluded : Status::cut;
  if (agreement.in_image < limits.min_in_image) return too_little;

  // Colours where they should not be.
  const double fraction = fit.located_fraction();
  const bool complete = agreement.matching > limits.complete_matching && fraction > limits.complete_fraction;
  const double tolerance = complete ? limits.tolerance_of_complete : 1;
  const bool surrounded =
      agreement.beyond > tolerance * limits.max_beyond || agreement.beside > tolerance * limits.max_beside;
  if (agreement.wrong > tolerance * limits.max_wrong ||
      (surrounded && !shows_wholly_among_others(scene, agreement, fit)))
    return Status::poor_fit;

  // Too little of the marker.
  if (agreement.matching < limits.min_matching) return Status::occluded;
  const int inner_used = fit.used[1] + fit.used[2], outer_used = fit.used[0] + fit.used[3];
  if (inner_used < std::max(limits.min_inner, fit.lines / limits.inner_one_in) || outer_used < limits.min_outer)
    return Status::occluded;
  // With the RCM both ends confirm what is left of a hidden marker; without it they are needed always.
  const bool hidden_by_another = !in_image && !scene.others.empty();
  const bool needs_both_ends = !fit.unknowns.q() ||
                               (fraction < limits.mostly_hidden && in_image && !needs_no_other_end(fit)) ||
                               (fraction < limits.well_located_beside_another && hidden_by_another);
  if (needs_both_ends && std::min(fit.used[0], fit.used[3]) < fewest_lines(fit)) return too_little;

  // Boundaries and sides that agree badly.
  if (fraction < limits.partly_hidden && agreement.spilled > max_spilled(fit) &&
      spilled_in_patches(scene, fit.unknowns.pose()) > max_spilled(fit))
    return Status::poor_fit;
  const bool all_show = 4 == std::count_if(fit.used.begin(), fit.used.end(),
                                           [&](int used) { return used > limits.missed_fraction * fit.lines; });
  const double max_rms_sigmas = all_show ? limits.max_rms_of_all_sigmas : limits.max_rms_sigmas;
  const bool few_sides = limits.sides_one_in * fit.sides_used < fit.sides_in_image;
  const double more_rms_sigmas = few_sides ? 0
                                           : limits.rms_per_fraction * std::clamp(fraction - limits.rms_from_fraction,
                                                                                  0.0, limits.rms_most_fraction);
  if (fraction < limits.min_fraction || fit.inlier_rms_sigmas > max_rms_sigmas + more_rms_sigmas)
    return Status::poor_fit;

  // Motion blur.
  const double motion_blur_px = fit.blur.widest_px();
  if (motion_blur_px > limits.lost_px) return Status::uncertain;
  const bool blurred = motion_blur_px > limits.motion_blurred_px;
  const int min_used = *std::min_element(fit.used.begin(), fit.used.end());
  if (blurred && limits.motion_blurred_end_of * min_used < limits.motion_blurred_end_parts * fit.lines)
    return Status::uncertain;
  // Few boundaries need the sides beside them.
  if ((blurred || fraction < limits.mostly_hidden) && fit.sides_used < limits.min_sides) return Status::uncertain;
  return validate_psi(scene, fit, agreement);
}

}  // namespace lapservo::internal
