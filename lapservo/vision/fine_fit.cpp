#include "lapservo/vision/fine_fit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>

#include <Eigen/LU>

#include "lapservo/vision/normal_equations.h"

namespace lapservo {
namespace {

// What the model leaves out (shading across the blur, lens, print) of each boundary and side as a whole.
constexpr double common_boundary_px = 0.008, common_side_px = 0.02;
// And as a share of the blur beyond a lens's: motion and defocus do not blur like a Gaussian, and beside a limb even
// less.
constexpr double usual_blur_px = 1.2, boundary_share_of_blur = 0.05, side_share_of_blur = 0.2;
// Where most of a marker is hidden, some of what was taken for its boundaries are the blood's.
constexpr double usual_share = 0.7, doubt_of_hidden = 4;
constexpr double cauchy_scale_sigmas = 2.5, inlier_sigmas = 5;
// A fit has settled when a pass moves no point and no smear (unsettled_px) farther than this.
constexpr double settled_px = 1.5;
constexpr int most_passes = 3;

double robust_weight(const Measurement& m, double residual_px) {
  return cauchy_weight(residual_px / m.sigma_px, cauchy_scale_sigmas) / (m.sigma_px * m.sigma_px);
}

// The unknowns of the pose, then the film's thickness in film_sigma_m.
UnknownVector extended_row(const Measurement& m) {
  UnknownVector row(m.row.size() + 1);
  row << m.row, m.by_film;
  return row;
}

// Minimises the robust cost of linearised measurements: iteratively reweighted. `film_prior` is what the film's
// thickness lies below its expected one, in sigmas.
UnknownVector solve(std::span<const Measurement> measurements, int unknowns, double film_prior) {
  constexpr int iterations = 4;
  UnknownVector step = UnknownVector::Zero(unknowns + 1);
  for (int i = 0; i < iterations; ++i) {
    NormalEquations equations(unknowns + 1);
    equations.add(UnknownVector::Unit(unknowns + 1, unknowns), film_prior, 1);
    for (const Measurement& m : measurements) {
      const UnknownVector row = extended_row(m);
      equations.add(row, m.residual_px, robust_weight(m, m.residual_px - row.dot(step)));
    }
    step = equations.solve(1e-9);
  }
  return step;
}

// Inverse information, widened by what each boundary and side as a whole may be off.
std::optional<UnknownMatrix> covariance_of(std::span<const Measurement> measurements, int unknowns,
                                           double residual_rms_sigmas, const EdgeBlur& blur) {
  NormalEquations equations(unknowns + 1);
  equations.add(UnknownVector::Unit(unknowns + 1, unknowns), 0, 1);
  std::array<UnknownVector, measurement_groups> pull;
  pull.fill(UnknownVector::Zero(unknowns + 1));
  for (const Measurement& m : measurements) {
    const UnknownVector row = extended_row(m);
    const double weight = robust_weight(m, m.residual_px);
    equations.add(row, 0, weight);
    pull[m.group] += weight * row;
  }
  const Eigen::FullPivLU<UnknownMatrix> lu(equations.information());
  if (!lu.isInvertible()) return std::nullopt;
  const UnknownMatrix inverse = lu.inverse();
  const double scale = std::max(1.0, residual_rms_sigmas);
  UnknownMatrix covariance = inverse;
  for (std::size_t group = 0; group < measurement_groups; ++group) {
    const UnknownVector shift = inverse * pull[group];
    const double common_px =
        group < 4 ? common_boundary_px + boundary_share_of_blur * std::max(0.0, blur.boundaries_px - usual_blur_px)
                  : common_side_px + side_share_of_blur * std::max(0.0, blur.sides_px - usual_blur_px);
    covariance += common_px * common_px * shift * shift.transpose();
  }
  covariance *= scale * scale;
  const UnknownMatrix of_pose = covariance.topLeftCorner(unknowns, unknowns);
  return of_pose.allFinite() && (of_pose.diagonal().array() > 0).all() ? std::optional(of_pose) : std::nullopt;
}

// What a change of blur weighs beside a movement of points. Motion's smear may be no blur, which then never settles; a
// sharp one may flicker where few sides are left.
double unsettled_px(double blur_before_px, double blur_after_px) {
  constexpr double sharp_px = 1.8, weight = 5;
  if (std::max(blur_before_px, blur_after_px) < sharp_px) return 0;
  return weight * std::abs(blur_after_px - blur_before_px);
}

}  // namespace

double FineFit::located_share() const {
  const int located = used[0] + used[1] + used[2] + used[3];
  return static_cast<double>(located) / std::max(1, in_image[0] + in_image[1] + in_image[2] + in_image[3]);
}

FineFit fit_finely(const Scene& scene, const LightImage& light, const PoseUnknowns& start, EdgeBlur blur) {
  constexpr Effort capture{5, 3, 3}, approach{2, 2, 3}, measure_all{2, 1, 1};
  FineFit fit;
  fit.unknowns = start;
  fit.blur = blur;
  const int unknowns = start.size();
  double film_m = film_mean_m;
  EdgeMeasurements pass;
  // Returns how far the measured points and the blur moved, in pixels; nullopt when too little was seen.
  const auto refine = [&](const Effort& effort) -> std::optional<double> {
    pass = measure_edges(scene, light, fit.unknowns, film_m, effort, fit.blur);
    if (static_cast<int>(pass.all.size()) < 2 * fit.unknowns.size()) return std::nullopt;
    const UnknownVector step = solve(pass.all, unknowns, (film_mean_m - film_m) / film_sigma_m);
    double moved_px = 0;
    for (Measurement& m : pass.all) {
      const double shift_px = extended_row(m).dot(step);
      m.residual_px -= shift_px;
      moved_px = std::max(moved_px, std::abs(shift_px));
    }
    const EdgeBlur improved{pass.boundary_blur.improved(fit.blur.boundaries_px),
                            pass.side_blur.improved(fit.blur.sides_px)};
    moved_px = std::max({moved_px, unsettled_px(fit.blur.boundaries_px, improved.boundaries_px),
                         unsettled_px(fit.blur.sides_px, improved.sides_px)});
    fit.blur = improved;
    fit.unknowns = fit.unknowns.changed_by(step.head(unknowns));
    film_m = std::clamp(film_m + step[unknowns] * film_sigma_m, 0.0, film_mean_m + 4 * film_sigma_m);
    if (!fit.unknowns.pose().camera_from_unrolled.translation.allFinite()) return std::nullopt;
    return moved_px;
  };
  const auto captured_px = refine(capture);
  if (!captured_px) return fit;
  if (*captured_px > settled_px && !refine(approach)) return fit;
  std::optional<double> moved_px = settled_px + 1;
  for (int i = 0; i < most_passes && moved_px && *moved_px > settled_px; ++i) moved_px = refine(measure_all);
  if (!moved_px || *moved_px > settled_px) return fit;
  fit.lines = pass.lines;
  fit.in_image = pass.in_image;
  double squares = 0;
  int inliers = 0;
  for (const Measurement& m : pass.all) {
    const double sigmas = std::abs(m.residual_px) / m.sigma_px;
    if (sigmas > inlier_sigmas) continue;
    m.group < 4 ? ++fit.used[m.group] : ++fit.sides_used;
    if (m.group < 4) squares += sigmas * sigmas, ++inliers;
  }
  fit.inlier_rms_sigmas = inliers ? std::sqrt(squares / inliers) : 0;
  const auto covariance = covariance_of(pass.all, fit.unknowns.size(), fit.inlier_rms_sigmas, fit.blur);
  if (!covariance) return fit;
  const double doubt = 1 + doubt_of_hidden * std::max(0.0, usual_share - fit.located_share());
  fit.covariance = doubt * doubt * *covariance;
  fit.converged = true;
  return fit;
}

}  // namespace lapservo
