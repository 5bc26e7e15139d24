#include "lapservo/vision/verification.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"

namespace lapservo::internal {
namespace {

constexpr double largest_sigma_psi_rad = 0.02;  // five sigma: a tenth of a radian
constexpr double least_matching = 0.3, most_wrong = 0.05, most_beyond = 0.5, most_beside = 0.2;
constexpr double tolerance_of_complete = 1.6;
constexpr double least_in_image = 0.25;
constexpr double well_seen_share = 0.7;  // to blame the print
constexpr double blurred_px = 1.5;       // colours mix so far on both sides of a boundary

// Of the marker; at least a pixel.
double length_in_image_px(const Scene& scene, const ShaftPose& pose, double azimuth_rad) {
  const auto px = [&](double along_m) {
    return scene.camera.raw_from_point(pose.camera_from_unrolled *
                                       surface_point(scene.marker.radius_m(), azimuth_rad, along_m));
  };
  const double length_px = (px(scene.marker.length_m()) - px(0)).norm();
  return std::isfinite(length_px) ? std::max(1.0, length_px) : 1.0;
}

// A boundary that lies too far from its place is not located at all, and nothing contradicts what the others say; where
// nothing hides the marker, that is the print.
bool misses_a_boundary(const FineFit& fit, const ColorAgreement& agreement) {
  constexpr double unhidden = 0.85, missed = 0.3, sharp_px = 1.8;
  constexpr int enough = 10;
  bool missing = false;
  for (std::size_t k = 0; k < 4; ++k) missing |= fit.in_image[k] >= enough && fit.used[k] < missed * fit.in_image[k];
  return missing && agreement.matching > unhidden && fit.blur.boundaries_px < sharp_px;
}

// The rotation's sigma, where the rig's tolerance of the print adds to it no more than it should: who sets that wants
// to live with it. By how much a print that is certainly off may be off is known from four numbers at best: ten sigma.
Status judge_sigma(const FineFit& fit, const ColorAgreement& agreement) {
  constexpr double certain = 0.999, slack = 1.5;
  const auto squared = [](double x) { return x * x; };
  const bool off = fit.print_off_probability > certain;
  const double limit = squared(off ? largest_sigma_psi_rad / 2 : largest_sigma_psi_rad);
  const Eigen::Index psi = fit.unknowns.size() - 1;
  const double variance = fit.covariance(psi, psi);
  if (fit.psi_variance_by_tolerance < limit && misses_a_boundary(fit, agreement)) return Status::marker_mismatch;
  if (variance < limit + slack * fit.psi_variance_by_tolerance) return Status::ok;
  const bool well_seen = fit.located_share() > well_seen_share;
  return well_seen && fit.psi_variance_by_print > variance / 2 ? Status::marker_mismatch : Status::uncertain;
}

}  // namespace

ColorAgreement color_agreement(const Scene& scene, const ShaftPose& pose) {
  constexpr int azimuths = 13, places = 40, margin = 5;
  constexpr double beside_radii = 1.2;
  ColorAgreement agreement;
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return agreement;
  const double length_m = scene.marker.length_m(), ring_m = 0.1 * length_m;
  const double guard_m =
      length_m * std::max(0.02, blurred_px / length_in_image_px(scene, pose, view->facing_azimuth_rad));
  int total = 0, inside = 0, matching = 0, wrong = 0, outer = 0, beyond = 0, flank = 0, beside = 0;
  std::array<int, 2> ring{}, spilled{};
  const Eigen::Vector3d axis = pose.camera_from_unrolled.rotation * Eigen::Vector3d::UnitZ();
  for (int i = 0; i < azimuths; ++i) {
    const double azimuth_rad = view->facing_azimuth_rad + 0.8 * view->half_visible_rad * (2.0 * i / (azimuths - 1) - 1);
    const auto ends_m = boundaries_m(scene.marker, azimuth_rad - pose.psi_rad - scene.marker.seam_rad);
    const Eigen::Vector3d base = pose.camera_from_unrolled * surface_point(scene.marker.radius_m(), azimuth_rad, 0);
    for (int k = -margin; k < places + margin; ++k) {
      const double along_m = length_m * (k + 0.5) / places;
      bool near_boundary = false;
      int band = 0;
      for (const double end_m : ends_m) near_boundary |= std::abs(end_m - along_m) < guard_m, band += along_m >= end_m;
      if (near_boundary) continue;
      const bool on_marker = band >= 1 && band <= 3;
      total += on_marker;
      const std::uint8_t color = scene.class_at_point(base + along_m * axis);
      if (color == Scene::outside) continue;
      const bool ours = scene.is_ours(color);
      if (!on_marker) {
        const std::size_t end = band < 1 ? 0 : 1;
        const double past_m = end == 0 ? ends_m[0] - along_m : along_m - ends_m[3];
        if (past_m < ring_m) ++ring[end], spilled[end] += color == scene.bands[2 * end];
        ++outer, beyond += ours;
        continue;
      }
      ++inside;
      const bool match = color == scene.bands[static_cast<std::size_t>(band - 1)];
      matching += match, wrong += ours && !match;
    }
  }
  for (const double side : {-1.0, 1.0}) {
    const Eigen::Vector3d base = pose.camera_from_unrolled * surface_point(beside_radii * scene.marker.radius_m(),
                                                                           view->facing_azimuth_rad + side * pi / 2, 0);
    for (int k = 0; k < places; ++k) {
      const std::uint8_t color = scene.class_at_point(base + length_m * (k + 0.5) / places * axis);
      if (color != Scene::outside) ++flank, beside += scene.is_ours(color);
    }
  }
  const auto share = [](int part, int whole) { return whole ? static_cast<double>(part) / whole : 0; };
  return {share(matching, inside), share(wrong, inside),
          share(inside, total),    share(beyond, outer),
          share(beside, flank),    std::max(share(spilled[0], ring[0]), share(spilled[1], ring[1]))};
}

Status judge(const Scene& scene, const FineFit& fit) {
  if (!fit.converged) return Status::poor_fit;
  const ColorAgreement agreement = color_agreement(scene, fit.unknowns.pose());
  if (agreement.in_image < least_in_image) return Status::cut;
  // Where all boundaries show as they should, other colours are noise: the dark has plenty under a high gain.
  const double share = fit.located_share();
  const double tolerance = agreement.matching > 0.6 && share > 0.9 ? tolerance_of_complete : 1;
  if (agreement.wrong > tolerance * most_wrong || agreement.beyond > tolerance * most_beyond ||
      agreement.beside > tolerance * most_beside)
    return Status::poor_fit;
  if (agreement.matching < least_matching) return Status::occluded;
  const int inner_used = fit.used[1] + fit.used[2], outer_used = fit.used[0] + fit.used[3];
  if (inner_used < std::max(6, fit.lines / 10) || outer_used < 4) return Status::occluded;
  // Without the RCM, only both ends together fix the depth and with it everything else. With it they confirm what is
  // left of a hidden marker.
  constexpr double mostly_hidden = 0.5, partly_hidden = 0.7, most_spilled = 0.12;
  const bool needs_both_ends = !fit.unknowns.q() || (share < mostly_hidden && agreement.in_image > 0.98);
  if (needs_both_ends && std::min(fit.used[0], fit.used[3]) < std::max(6, fit.lines / 12))
    return agreement.in_image < 0.98 ? Status::cut : Status::occluded;
  // Wrong fits agree with few boundaries or sides, and badly; blood leaves few, which agree well; compression leaves
  // many, noisy.
  if (share < partly_hidden && agreement.spilled > most_spilled) return Status::poor_fit;
  const bool few_sides = 4 * fit.sides_used < fit.sides_in_image;
  const double largest_rms_sigmas = 1.3 + (few_sides ? 0 : 5.5 * std::clamp(share - 0.7, 0.0, 0.2));
  if (share < 0.2 || fit.inlier_rms_sigmas > largest_rms_sigmas) return Status::poor_fit;
  // Smeared by motion across, the sides hold the shaft's place no more; and few boundaries need the sides beside them.
  // A smeared end that most lines miss is not hidden: what they found is another.
  // Beyond some width the smear's form, which nobody knows, decides where the edges are taken to be.
  constexpr double smeared_px = 2, lost_px = 4.5;
  constexpr int fewest_sides = 8;
  const double smear_px = std::max(fit.blur.boundaries_px, fit.blur.sides_px);
  const bool smeared = smear_px > smeared_px;
  if (smear_px > lost_px) return Status::uncertain;
  if (smeared && 5 * *std::min_element(fit.used.begin(), fit.used.end()) < 3 * fit.lines) return Status::uncertain;
  if ((smeared || share < mostly_hidden) && fit.sides_used < fewest_sides) return Status::uncertain;
  return judge_sigma(fit, agreement);
}

}  // namespace lapservo::internal
