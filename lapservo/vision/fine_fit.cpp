#include "lapservo/vision/fine_fit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>

#include <Eigen/LU>

#include "lapservo/core/angles.h"
#include "lapservo/core/inplace_vector.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/vision/edge_profile.h"
#include "lapservo/vision/normal_equations.h"

namespace lapservo {
namespace {

constexpr int most_lines = 96, fewest_lines = 12, stations = 28;
constexpr double line_reach = 0.9;  // of the visible half width: beyond, light and resolution are gone
// What the model leaves out (shading across the blur, lens, print): of every single measurement, and of each boundary
// and side as a whole.
constexpr double single_floor_px = 0.04, common_boundary_px = 0.008, common_side_px = 0.02;
// And as a share of the blur beyond a lens's: motion and defocus do not blur like a Gaussian.
constexpr double usual_blur_px = 1.2, common_share_of_blur = 0.05;
// Where most of a marker is hidden, some of what was taken for its boundaries are the blood's.
constexpr double usual_share = 0.7, doubt_of_hidden = 4;
constexpr double cauchy_scale_sigmas = 2.5, inlier_sigmas = 5;
// A fit has settled when a pass moves no point and no smear (unsettled_px) farther than this.
constexpr double settled_px = 1.5;
constexpr int most_passes = 3;
// Interpolated samples are smoother than the pixels are noisy.
constexpr double interpolation_noise = 1.6;

// The film that carries the marker stands out from the shaft. Seen from beyond an end, its edge shows too and moves the
// apparent end inwards (towards the axis) by the film's thickness, as far as the edge is lit compared with the outside:
// diffusely from the camera, with some ambient light. The rig does not say how thick it is, so each fit estimates it.
constexpr double film_mean_m = 0.07e-3, film_sigma_m = 0.04e-3;
constexpr double ambient_share = 0.18, most_lit = 2;

struct Measurement {
  UnknownVector row;   // d(position along the image normal)/d(unknowns)
  double by_film = 0;  // d(...)/d(film thickness), pixels per film_sigma_m
  double residual_px;  // along the normal
  double sigma_px;
  std::size_t group;  // 0..3 boundary, 4 and 5 the sides
};
constexpr std::size_t groups = 6;

constexpr std::size_t most_measurements = 4 * most_lines + 2 * stations;

struct Pass {
  InplaceVector<Measurement, most_measurements> measurements;
  std::array<int, 4> in_image{};
  int lines = 0;
  struct BlurEvidence {
    double gradient = 0, information = 0;
    void add(const EdgeFit& edge, double variance) {
      gradient += edge.blur_gradient / variance;
      information += edge.blur_information / variance;
    }
    // The blur after a Gauss-Newton step of limited size.
    double improved(double blur_px) const {
      if (!(information > 0)) return blur_px;
      return std::clamp(blur_px + gradient / information, std::max(0.5, 0.6 * blur_px), std::min(8.0, 1.7 * blur_px));
    }
  };
  BlurEvidence boundary_blur, side_blur;
};

// How far beyond the blur a pass looks for edges, and how often it refines each before the pose.
struct Effort {
  double extra_px;
  int iterations;
  int thinning;  // uses every so many generatrices and stations
};

// What a pass measures with.
struct Frame {
  const Scene& scene;
  const LightImage& light;
  const PoseUnknowns& unknowns;
  double film_m;
  CylinderView view;
  Eigen::Matrix3d axes;  // of the unrolled frame, in the camera

  const Marker& marker() const { return scene.marker; }
  Eigen::Vector3d point(double azimuth_rad, double along_m) const {
    return unknowns.pose().camera_from_unrolled * surface_point(marker().radius_m(), azimuth_rad, along_m);
  }
  // How brightly the film's edge at boundary k shows, relative to the outside beside it; 0 when it is not seen.
  double film_light(std::size_t k, double azimuth_rad) const {
    if (k == 1 || k == 2) return 0;
    const Eigen::Vector3d to_camera = unknowns.pose().camera_from_unrolled.inverse().translation -
                                      surface_point(marker().radius_m(), azimuth_rad, k == 0 ? 0 : marker().length_m());
    const double beyond = (k == 0 ? -to_camera.z() : to_camera.z()) / to_camera.norm();
    if (beyond <= 0) return 0;
    const double facing = surface_point(1, azimuth_rad, 0).dot(to_camera) / to_camera.norm();
    const auto lit = [](double cosine) { return ambient_share + (1 - ambient_share) * std::max(0.0, cosine); };
    return std::min(lit(beyond) / lit(facing), most_lit);
  }
  double tau(double azimuth_rad) const { return azimuth_rad - unknowns.pose().psi_rad - marker().seam_rad; }
};

std::optional<EdgeProfile> sample_profile(const Frame& frame, const Eigen::Vector2d& centre_px,
                                          const Eigen::Vector2d& direction, int before, int after) {
  if (!frame.light.contains(centre_px - before * direction) || !frame.light.contains(centre_px + after * direction))
    return std::nullopt;
  EdgeProfile profile;
  profile.first_px = static_cast<float>(-before);
  profile.count = std::min(static_cast<std::size_t>(before + after + 1), EdgeProfile::max_samples);
  const auto u = static_cast<float>(centre_px.x()), v = static_cast<float>(centre_px.y());
  const auto du = static_cast<float>(direction.x()), dv = static_cast<float>(direction.y());
  for (std::size_t i = 0; i < profile.count; ++i) {
    const float t = profile.first_px + static_cast<float>(i);
    const LightImage::Sample sample = frame.light.at(u + t * du, v + t * dv);
    for (std::size_t c = 0; c < 3; ++c) {
      profile.light[c][i] = sample.light[c];
      profile.usable[c][i] = !sample.saturated[c];
      profile.all_usable &= !sample.saturated[c];
    }
  }
  return profile;
}

// A located boundary before it is trusted.
struct Candidate {
  Measurement measurement;
  EdgeFit edge;
  bool colors_agree;
  double normal_cosine;
};

bool colors_agree(const Frame& frame, std::size_t k, const Eigen::Vector2d& at_px, const Eigen::Vector2d& along,
                  double reach_px) {
  const std::uint8_t before = frame.scene.class_at(at_px - reach_px * along);
  const std::uint8_t after = frame.scene.class_at(at_px + reach_px * along);
  return before == (k == 0 ? 0 : frame.scene.bands[k - 1]) && after == (k == 3 ? 0 : frame.scene.bands[k]);
}

std::optional<Candidate> measure_boundary(const Frame& frame, double azimuth_rad, std::size_t k,
                                          const std::array<double, 4>& along_m, double slope_m, const Effort& effort,
                                          double blur_px, int& in_image) {
  const double film_light = frame.film_light(k, azimuth_rad);
  const Eigen::Vector3d outwards = frame.axes * surface_point(1, azimuth_rad, 0);
  const Eigen::Vector3d point = frame.point(azimuth_rad, along_m[k]) - film_light * frame.film_m * outwards;
  if (!(point.z() > 1e-3)) return std::nullopt;
  const ProjectionWithJacobian image = frame.scene.camera.raw_with_jacobian(point);
  const Eigen::Vector2d axis_px = image.d_px_d_point * frame.axes.col(2);
  const double px_per_m = axis_px.norm();
  const Eigen::Vector2d along = axis_px / px_per_m;
  const Eigen::Vector3d around = frame.axes * Eigen::Vector3d(-std::sin(azimuth_rad), std::cos(azimuth_rad), 0);
  const Eigen::Vector2d tangent =
      (image.d_px_d_point * (frame.marker().radius_m() * around + slope_m * frame.axes.col(2))).normalized();
  const Eigen::Vector2d normal(-tangent.y(), tangent.x());
  const double cosine = normal.dot(along);
  if (!(std::abs(cosine) > 0.3)) return std::nullopt;

  double gap_px = 1e9;
  if (k > 0) gap_px = std::min(gap_px, (along_m[k] - along_m[k - 1]) * px_per_m);
  if (k < 3) gap_px = std::min(gap_px, (along_m[k + 1] - along_m[k]) * px_per_m);
  const double line_blur_px = blur_px / std::abs(cosine);
  const int reach =
      static_cast<int>(std::min({2.5 * line_blur_px + effort.extra_px, 0.6 * gap_px - line_blur_px, 22.0}));
  if (reach < 3) return std::nullopt;
  const auto profile = sample_profile(frame, image.point_px, along, reach, reach);
  if (!profile) return std::nullopt;
  ++in_image;
  Candidate candidate;
  candidate.edge = fit_step(*profile, static_cast<float>(line_blur_px), effort.iterations);
  if (!candidate.edge.converged) return std::nullopt;
  const Eigen::Vector2d located_px = image.point_px + candidate.edge.offset_px * along;
  candidate.colors_agree = colors_agree(frame, k, located_px, along, 0.8 * reach);
  const Eigen::Vector3d pull = image.d_px_d_point.transpose() * normal;
  candidate.measurement.row = frame.unknowns.row(point, pull);
  candidate.measurement.row[candidate.measurement.row.size() - 1] = -slope_m * pull.dot(frame.axes.col(2));
  candidate.measurement.by_film = -film_light * film_sigma_m * pull.dot(outwards);
  candidate.measurement.residual_px = candidate.edge.offset_px * cosine;
  candidate.measurement.group = k;
  candidate.normal_cosine = cosine;
  return candidate;
}

// Reorders the values.
float median(std::span<float> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Keeps the candidates of one boundary whose change of light is what most see where the colours agree; gives each its
// sigma from the noise that the lines show.
void trust(std::span<Candidate> candidates, Pass& pass) {
  std::array<float, 3> typical{};
  InplaceVector<float, most_lines> values;
  for (std::size_t c = 0; c < 3; ++c) {
    values.clear();
    for (const Candidate& candidate : candidates)
      if (candidate.colors_agree) values.push_back(candidate.edge.step[c]);
    if (values.size() < 3) return;
    typical[c] = median(values);
  }
  values.clear();
  for (const Candidate& candidate : candidates)
    if (candidate.colors_agree) values.push_back(candidate.edge.residual_variance);
  const double typical_variance = median(values);
  const auto dot = [](const std::array<float, 3>& a, const std::array<float, 3>& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  };
  const float typical_square = dot(typical, typical);
  for (Candidate& candidate : candidates) {
    const auto& step = candidate.edge.step;
    const float projection = dot(step, typical), square = dot(step, step);
    const bool alike = projection > 0.25F * typical_square && projection * projection > 0.7F * square * typical_square;
    if (!alike || candidate.edge.residual_variance > 0.05F * square + 9 * typical_variance) continue;
    const double variance = 0.5 * (candidate.edge.residual_variance + typical_variance) * interpolation_noise;
    const double along_variance = variance / candidate.edge.information;
    candidate.measurement.sigma_px = std::sqrt(along_variance * candidate.normal_cosine * candidate.normal_cosine +
                                               single_floor_px * single_floor_px);
    pass.measurements.push_back(candidate.measurement);
    pass.boundary_blur.add(candidate.edge, variance);
  }
}

void measure_boundaries(const Frame& frame, const Effort& effort, double blur_px, Pass& pass) {
  const double radius_px = frame.marker().radius_m() / frame.view.camera_to_axis_m * frame.scene.camera.fx_px;
  pass.lines = std::max(fewest_lines, std::min(static_cast<int>(1.8 * radius_px), most_lines) / effort.thinning);
  const auto slopes_m = boundary_slopes_m(frame.marker());
  std::array<InplaceVector<Candidate, most_lines>, 4> candidates;
  for (int i = 0; i < pass.lines; ++i) {
    const double sine = line_reach * (2.0 * (i + 0.5) / pass.lines - 1) * std::sin(frame.view.half_visible_rad);
    const double azimuth_rad = frame.view.facing_azimuth_rad + std::asin(sine);
    const double tau_rad = frame.tau(azimuth_rad);
    const auto along_m = boundaries_m(frame.marker(), tau_rad);
    const double seam_px = std::abs(wrap_pi(tau_rad)) * radius_px * std::sqrt(1 - sine * sine);
    for (std::size_t k = 0; k < 4; ++k) {
      const bool inner = k == 1 || k == 2;
      if (inner && seam_px < 2.5 * blur_px + 1.5) continue;
      if (auto candidate =
              measure_boundary(frame, azimuth_rad, k, along_m, slopes_m[k], effort, blur_px, pass.in_image[k]))
        candidates[k].push_back(*candidate);
    }
  }
  for (auto& of_boundary : candidates) trust(of_boundary, pass);
}

// Whether one band fills the section between two azimuths at a place, with some room.
bool one_band(const Frame& frame, double azimuth_a_rad, double azimuth_b_rad, double along_m, double room_m) {
  const double tau_a = wrap_two_pi(frame.tau(azimuth_a_rad)), tau_b = wrap_two_pi(frame.tau(azimuth_b_rad));
  if (std::abs(tau_a - tau_b) > pi) return false;  // the seam lies between
  const auto band = [&](double tau, double x) {
    const auto e = boundaries_m(frame.marker(), tau);
    return std::upper_bound(e.begin(), e.end(), x) - e.begin();
  };
  const auto first = band(tau_a, along_m - room_m);
  return first >= 1 && first <= 3 && first == band(tau_a, along_m + room_m) && first == band(tau_b, along_m - room_m) &&
         first == band(tau_b, along_m + room_m);
}

void measure_sides(const Frame& frame, const Effort& effort, double blur_px, Pass& pass) {
  const double length_m = frame.marker().length_m();
  InplaceVector<float, 2 * stations> variances;
  struct Side {
    Measurement measurement;
    EdgeFit edge;
  };
  InplaceVector<Side, 2 * stations> sides;
  const int count = stations / effort.thinning;
  for (int station = 0; station < count; ++station) {
    const double along_m = length_m * (station + 0.5) / count;
    for (const double side : {-1.0, 1.0}) {
      const double azimuth_rad = frame.view.facing_azimuth_rad + side * frame.view.half_visible_rad;
      const Eigen::Vector3d point = frame.point(azimuth_rad, along_m);
      if (!(point.z() > 1e-3)) continue;
      const ProjectionWithJacobian image = frame.scene.camera.raw_with_jacobian(point);
      const Eigen::Vector2d along = (image.d_px_d_point * frame.axes.col(2)).normalized();
      const Eigen::Vector3d inside_point = frame.point(azimuth_rad - side * 0.9, along_m);
      const Eigen::Vector2d inwards_rough = frame.scene.camera.raw_from_point(inside_point) - image.point_px;
      Eigen::Vector2d inwards(-along.y(), along.x());
      if (inwards.dot(inwards_rough) < 0) inwards = -inwards;
      const double radius_px = frame.marker().radius_m() / point.norm() * frame.scene.camera.fx_px;
      const int inside = static_cast<int>(std::min(0.34 * radius_px, 26.0));
      const int outside = static_cast<int>(std::min(2.5 * blur_px + effort.extra_px, 14.0));
      if (inside < 5) continue;
      const double deep_azimuth_rad = azimuth_rad - side * 0.87;  // where d = R (1 - cos 0.87) = 0.35 R
      if (!one_band(frame, azimuth_rad, deep_azimuth_rad, along_m, 2.5 * blur_px * length_m / 200)) continue;
      const auto profile = sample_profile(frame, image.point_px, inwards, outside, inside);
      if (!profile) continue;
      Side measured;
      measured.edge = fit_limb(*profile, static_cast<float>(blur_px), static_cast<float>(radius_px), effort.iterations);
      if (!measured.edge.converged) continue;
      measured.measurement.row = frame.unknowns.row(point, image.d_px_d_point.transpose() * inwards);
      measured.measurement.residual_px = measured.edge.offset_px;
      measured.measurement.group = side < 0 ? 4 : 5;
      variances.push_back(measured.edge.residual_variance);
      sides.push_back(measured);
    }
  }
  if (sides.size() < 4) return;
  const double typical_variance = median(variances);
  for (Side& side : sides) {
    const double variance =
        0.5 * (side.edge.residual_variance + typical_variance) * interpolation_noise / side.edge.information;
    side.measurement.sigma_px = std::sqrt(variance + 4 * single_floor_px * single_floor_px);
    if (side.measurement.sigma_px > 2) continue;
    pass.measurements.push_back(side.measurement);
    pass.side_blur.add(side.edge, variance * side.edge.information);
  }
}

Pass measure(const Scene& scene, const LightImage& light, const PoseUnknowns& unknowns, double film_m,
             const Effort& effort, const EdgeBlur& blur) {
  Pass pass;
  const auto view = view_cylinder(unknowns.pose().camera_from_unrolled, scene.marker.radius_m());
  if (!view) return pass;
  const Frame frame{scene,  light, unknowns,
                    film_m, *view, unknowns.pose().camera_from_unrolled.rotation.toRotationMatrix()};
  measure_boundaries(frame, effort, blur.boundaries_px, pass);
  measure_sides(frame, effort, blur.sides_px, pass);
  return pass;
}

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
  std::array<UnknownVector, groups> pull;
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
  for (std::size_t group = 0; group < groups; ++group) {
    const UnknownVector shift = inverse * pull[group];
    const double blur_px = group < 4 ? blur.boundaries_px : blur.sides_px;
    const double common_px = (group < 4 ? common_boundary_px : common_side_px) +
                             common_share_of_blur * std::max(0.0, blur_px - usual_blur_px);
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
  Pass pass;
  // Returns how far the measured points and the blur moved, in pixels; nullopt when too little was seen.
  const auto refine = [&](const Effort& effort) -> std::optional<double> {
    pass = measure(scene, light, fit.unknowns, film_m, effort, fit.blur);
    if (static_cast<int>(pass.measurements.size()) < 2 * fit.unknowns.size()) return std::nullopt;
    const UnknownVector step = solve(pass.measurements, unknowns, (film_mean_m - film_m) / film_sigma_m);
    double moved_px = 0;
    for (Measurement& m : pass.measurements) {
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
  for (const Measurement& m : pass.measurements) {
    const double sigmas = std::abs(m.residual_px) / m.sigma_px;
    if (sigmas > inlier_sigmas) continue;
    m.group < 4 ? ++fit.used[m.group] : ++fit.sides_used;
    if (m.group < 4) squares += sigmas * sigmas, ++inliers;
  }
  fit.inlier_rms_sigmas = inliers ? std::sqrt(squares / inliers) : 0;
  const auto covariance = covariance_of(pass.measurements, fit.unknowns.size(), fit.inlier_rms_sigmas, fit.blur);
  if (!covariance) return fit;
  const double doubt = 1 + doubt_of_hidden * std::max(0.0, usual_share - fit.located_share());
  fit.covariance = doubt * doubt * *covariance;
  fit.converged = true;
  return fit;
}

}  // namespace lapservo
