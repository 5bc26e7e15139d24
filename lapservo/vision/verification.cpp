#include "lapservo/vision/verification.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "lapservo/geometry/cylinder.h"

namespace lapservo {
namespace {

constexpr double largest_sigma_psi_rad = 0.03;
constexpr double least_matching = 0.3, most_wrong = 0.12, most_beyond = 0.5;
constexpr double least_in_image = 0.25;

}  // namespace

ColorAgreement color_agreement(const Scene& scene, const ShaftPose& pose) {
  constexpr int azimuths = 13, places = 40, margin = 5;
  ColorAgreement agreement;
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return agreement;
  const double length_m = scene.marker.length_m(), guard_m = 0.02 * length_m;
  int total = 0, inside = 0, matching = 0, wrong = 0, outer = 0, beyond = 0;
  for (int i = 0; i < azimuths; ++i) {
    const double azimuth_rad = view->facing_azimuth_rad + 0.8 * view->half_visible_rad * (2.0 * i / (azimuths - 1) - 1);
    const auto ends_m = boundaries_m(scene.marker, azimuth_rad - pose.psi_rad - scene.marker.seam_rad);
    for (int k = -margin; k < places + margin; ++k) {
      const double along_m = length_m * (k + 0.5) / places;
      const bool near_boundary =
          std::any_of(ends_m.begin(), ends_m.end(), [&](double end_m) { return std::abs(end_m - along_m) < guard_m; });
      if (near_boundary) continue;
      const auto band = std::upper_bound(ends_m.begin(), ends_m.end(), along_m) - ends_m.begin();
      const bool on_marker = band >= 1 && band <= 3;
      total += on_marker;
      const Eigen::Vector3d point =
          pose.camera_from_unrolled * surface_point(scene.marker.radius_m(), azimuth_rad, along_m);
      const std::uint8_t color = point.z() > 1e-3 ? scene.class_at(scene.camera.raw_from_point(point)) : Scene::outside;
      if (color == Scene::outside) continue;
      const bool ours = color == scene.bands[0] || color == scene.bands[1] || color == scene.bands[2];
      if (!on_marker) {
        ++outer, beyond += ours;
        continue;
      }
      ++inside;
      const bool match = color == scene.bands[static_cast<std::size_t>(band - 1)];
      matching += match, wrong += ours && !match;
    }
  }
  const auto share = [](int part, int whole) { return whole ? static_cast<double>(part) / whole : 0; };
  return {share(matching, inside), share(wrong, inside), share(inside, total), share(beyond, outer)};
}

Status judge(const Scene& scene, const FineFit& fit) {
  if (!fit.converged) return Status::poor_fit;
  const ColorAgreement agreement = color_agreement(scene, fit.unknowns.pose());
  if (agreement.in_image < least_in_image) return Status::cut;
  if (agreement.wrong > most_wrong || agreement.beyond > most_beyond) return Status::poor_fit;
  if (agreement.matching < least_matching) return Status::occluded;
  const int inner_used = fit.used[1] + fit.used[2], outer_used = fit.used[0] + fit.used[3];
  if (inner_used < std::max(6, fit.lines / 10) || outer_used < 4) return Status::occluded;
  // Without the RCM, only both ends together fix the depth and with it everything else.
  constexpr int fewest_of_an_end = 6;
  if (!fit.unknowns.q() && std::min(fit.used[0], fit.used[3]) < fewest_of_an_end)
    return agreement.in_image < 0.98 ? Status::cut : Status::occluded;
  const int located = inner_used + outer_used;
  const int expected = fit.in_image[0] + fit.in_image[1] + fit.in_image[2] + fit.in_image[3];
  // Wrong fits agree with few boundaries, and badly; blood leaves few, which agree well; compression leaves many,
  // noisy.
  const double share = static_cast<double>(located) / std::max(1, expected);
  if (share < 0.2 || fit.inlier_rms_sigmas > 1.2 + 1.5 * share) return Status::poor_fit;
  // Smeared by motion across, the sides hold the shaft's place no more.
  constexpr double smeared_px = 2.5;
  constexpr int fewest_sides = 8;
  if (std::max(fit.blur.boundaries_px, fit.blur.sides_px) > smeared_px && fit.sides_used < fewest_sides)
    return Status::uncertain;
  const Eigen::Index psi = fit.unknowns.size() - 1;
  if (!(std::sqrt(fit.covariance(psi, psi)) < largest_sigma_psi_rad)) return Status::uncertain;
  return Status::ok;
}

}  // namespace lapservo
