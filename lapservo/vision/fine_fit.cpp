#include "lapservo/vision/fine_fit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/core/median.h"
#include "lapservo/vision/limits.h"
#include "lapservo/vision/normal_equations.h"
#include "lapservo/vision/picture_processing.h"

namespace lapservo::internal {
namespace {

constexpr int max_passes = 3, max_wide_passes = 5, most_departures = 2, passes_of_departure = 2;

double robust_weight(const Measurement& m, double residual_px) {
  return cauchy_weight(residual_px / m.sigma_px, cauchy_scale_sigmas) / (m.sigma_px * m.sigma_px);
}

// Minimises the robust cost of linearised measurements: iteratively reweighted. The unknowns are the pose's, then the
// film's thickness in film_sigma_m; `film_prior` is what that lies below its expected one.
template <int Size>
UnknownVector solve(std::span<const Measurement> measurements, double film_prior) {
  constexpr int max_iterations = 4;
  using Row = Eigen::Matrix<double, Size, 1>;
  Row step = Row::Zero();
  for (int i = 0; i < max_iterations; ++i) {
    NormalEquations equations(Size);
    equations.add(Row::Unit(Size - 1), film_prior, 1);
    for (const Measurement& m : measurements) {
      const Row row = m.row.head<Size>();
      equations.add(row, m.residual_px, robust_weight(m, m.residual_px - row.dot(step)));
    }
    const Row next = equations.solve(1e-9), change = next - step;
    step = next;
    if (change.dot(equations.information() * change) < fine_fit_limits.settled_sigmas * fine_fit_limits.settled_sigmas)
      break;
  }
  return step;
}

double median_sigma_px(std::span<const Measurement> measurements) {
  InplaceVector<double, 4 * EdgeMeasurements::max_lines> sigmas_px;
  for (const Measurement& m : measurements)
    if (m.group < 4) sigmas_px.push_back(m.sigma_px);
  return sigmas_px.empty() ? 0 : median(sigmas_px);
}

// By which noise is smaller than the measurements say: of what they have beyond the light's, for what single points may
// be off besides, no more than their scatter shows.
double told_noise_scale(double scatter_sigmas, double sigma_px) {
  const double floor = edge_limits.single_floor_px / std::max(sigma_px, edge_limits.single_floor_px);
  const double of_light = std::sqrt(1 - floor * floor);
  return std::clamp(scatter_sigmas, std::max(of_light, fine_fit_limits.least_noise_scale), 1.0);
}

// What each boundary and side as a whole may be off, and the noise as it is. `bias_px`: by how much the camera's
// processing may have moved each boundary; of those that `processed` tells, it is corrected.
CommonErrors common_errors(const EdgeMeasurements& pass, const ResidualLines& lines, const EdgeBlur& blur,
                           const std::optional<ProcessedEdges>& processed, const std::array<double, 4>& bias_px,
                           const CameraDeparture& departure) {
  const FineFitLimits& limits = fine_fit_limits;
  const double widest_px = blur.widest_px();
  const double beyond_px = std::max(0.0, widest_px - limits.usual_blur_px);
  const auto beyond_px2 = [](double blur_px, double usual_px) {
    return std::max(0.0, blur_px * blur_px - usual_px * usual_px);
  };
  const double side_px = limits.common_side_px +
                         limits.side_of_blur * beyond_px2(blur.sides_px, limits.usual_side_blur_px) / pass.radius_px;
  const double unexplained = processed ? std::max(0.0, processed->misfit - limits.usual_misfit) : 0;
  const double unexplained_px = limits.px_per_misfit * unexplained;
  CommonErrors errors;
  double bias_squares_px2 = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    const double boundary_px = limits.common_boundary_px +
                               limits.common_fraction_of_blur * std::max(0.0, blur.along_px[k] - limits.usual_blur_px);
    const bool corrected = processed && processed->bias_px[k];
    const double fraction = processed && processed->clips ? limits.fraction_of_clipped : limits.fraction_of_processing;
    const double left_px = (corrected ? fraction : 1) * bias_px[k];
    const double camera_px = std::hypot(left_px, unexplained_px, departure.doubt_px[k]);
    errors.px[k] = std::hypot(boundary_px, camera_px);
    errors.told_px[k] = std::hypot(boundary_px - limits.untold_boundary_px, camera_px);
    bias_squares_px2 += bias_px[k] * bias_px[k] / 4;
  }
  errors.px[4] = errors.px[5] = side_px;
  errors.told_px[4] = errors.told_px[5] = side_px - limits.untold_side_px;
  errors.whole_px = limits.whole_fraction_of_blur * beyond_px;
  errors.leaning_px = (blur.wide() ? limits.leaning_of_wide_blur : limits.leaning_of_blur) *
                      beyond_px2(widest_px, limits.usual_blur_px) / pass.radius_px;
  const double scatter = scatter_sigmas(pass.all, lines), sigma_px = median_sigma_px(pass.all);
  errors.noise_scale = std::max(1.0, scatter);
  errors.told_noise_scale = told_noise_scale(scatter, sigma_px);
  const double moved_px = std::sqrt(bias_squares_px2);
  errors.inner_doubt_scale = doubt_scale(sigma_px, widest_px, moved_px);
  const double beyond_usual_px = std::max(0.0, sigma_px - limits.usual_sigma_px);
  const double processed_px = (processed ? limits.doubted_of_processing : 1) * moved_px;
  const double moved_or_noisy_px = std::hypot(limits.doubted_of_sigma * beyond_usual_px, processed_px);
  errors.doubt.boundary_px = std::hypot(moved_or_noisy_px, limits.doubted_boundary_of_blur * beyond_px);
  errors.doubt.tilt_px = std::hypot(moved_or_noisy_px, limits.doubted_tilt_of_blur * beyond_px);
  errors.doubt.length_fraction =
      std::hypot(limits.doubted_length_of_sigma * beyond_usual_px, limits.doubted_length_of_blur * beyond_px);
  return errors;
}

// What a pass changed.
struct Change {
  double points_px = 0;       // how far the farthest measured point moved
  double blur_fraction = 0;   // by how much the blur did, of what it was
  double motion_blur_px = 0;  // by how much a blur beyond a lens's did
  double oblique_px2 = 0;     // by how much its covariance along the shaft and across it did, at most

  void add_blur(double before_px, double after_px) {
    blur_fraction = std::max(blur_fraction, std::abs(after_px / before_px - 1));
    if (std::max(before_px, after_px) > fine_fit_limits.sharp_blur_px)
      motion_blur_px = std::max(motion_blur_px, std::abs(after_px - before_px));
  }
  // Motion blur may be no blur, which then never settles.
  bool settled() const {
    return std::max(points_px, fine_fit_limits.motion_blur_weight * motion_blur_px) < fine_fit_limits.settled_px;
  }
  // Whether the blur's covariance is known, which moves boundaries.
  bool ellipse_settled() const { return oblique_px2 < fine_fit_limits.settled_oblique_px2; }
  // Whether edges located with the blur before are good enough for the last pass.
  bool sharp() const { return blur_fraction < fine_fit_limits.settled_blur; }
};

// What the camera did to the picture, as it looks when what is known of the camera is undone; and all of its departure
// from the rig's, where that is more than was known.
struct SeenCamera {
  ProcessingEvidence evidence;
  std::optional<CameraDeparture> departure;
  int explained = 0, asked_for_departure = 0;  // so often
};

// A departure is believed if the picture looks unprocessed without it: processing moves channels apart, too.
SeenCamera look_at_camera(const LightImage& light, std::span<const Measurement> measurements, double blur_px,
                          const CameraDeparture& known) {
  SeenCamera out;
  if (blur_px > processing_limits.max_blur_px) return out;
  const DepartedLight seen(light, known);
  const PooledEdges glance = glance_at(seen.light(), measurements);
  out.evidence = find_processing(seen.light(), measurements, glance, blur_px);
  out.explained += out.evidence.explained;
  if (out.evidence.processing == Processing::found) return out;
  ++out.asked_for_departure;
  const auto more = find_departure(seen.light(), measurements, glance, blur_px);
  if (!more) return out;
  const CameraDeparture all = known.then(*more);
  const DepartedLight without(light, all);
  const ProcessingEvidence left = find_processing(without.light(), measurements, blur_px);
  out.explained += left.explained;
  if (left.processing == Processing::none) out.departure = all;
  return out;
}

// One fit: passes of locating edges and moving there, a look at what the camera did, and the print.
class Fitter {
 public:
  // `fit` holds what it starts from, and the result.
  Fitter(const Scene& scene, const LightImage& light, FineFit& fit) : scene_(scene), light_(light), fit_(fit) {}
  // Each returns whether to go on; what is known by then is in the result.
  bool settle();
  bool see_camera(const ExpectedProcessing& expected);
  void judge();

 private:
  static constexpr Effort capture{5, 3, 3}, approach{4, 6, 3}, measure_all{2, 1, 1};

  int unknowns() const { return fit_.unknowns.size(); }
  double film_prior() const { return (film_mean_m - film_m_) / film_sigma_m; }
  double move();
  Change take_blur(const EdgeBlur& improved);
  std::optional<Change> refine(const Effort& effort);
  void take_processing_off(const ProcessedEdges& edges);
  void count_inliers();
  void tell(const PrintFit& print);

  const Scene& scene_;
  const LightImage& light_;
  FineFit& fit_;
  double film_m_ = film_mean_m;
  EdgeMeasurements pass_;
  EdgeBlur located_with_;
  std::optional<ProcessedEdges> processed_;
};

// To where the measurements are; how far the farthest of them moved [px].
double Fitter::move() {
  const UnknownVector step = unknowns() == 4 ? solve<5>(pass_.all, film_prior()) : solve<7>(pass_.all, film_prior());
  double farthest_px = 0;
  for (Measurement& m : pass_.all) {
    const double shift_px = m.row.dot(step);
    m.residual_px -= shift_px;
    m.expected_px += static_cast<float>(shift_px) * m.normal;
    farthest_px = std::max(farthest_px, std::abs(shift_px));
  }
  fit_.unknowns = fit_.unknowns.changed_by(step.head(unknowns()));
  film_m_ = std::clamp(film_m_ + step[unknowns()] * film_sigma_m, 0.0, film_mean_m + 4 * film_sigma_m);
  return farthest_px;
}

Change Fitter::take_blur(const EdgeBlur& improved) {
  Change change;
  const EdgeBlur& before = fit_.blur;
  for (std::size_t k = 0; k < 4; ++k) change.add_blur(before.along_px[k], improved.along_px[k]);
  change.add_blur(before.sides_px, improved.sides_px);
  change.oblique_px2 = before.widest_px() * before.widest_px() * std::abs(improved.correlation - before.correlation);
  fit_.blur = improved;
  return change;
}

// Nullopt when too little was seen.
std::optional<Change> Fitter::refine(const Effort& effort) {
  ++fit_.passes;
  located_with_ = fit_.blur;
  const DepartedLight seen(light_, fit_.departure);
  pass_ = measure_edges(scene_, seen.light(), fit_.unknowns, film_m_, effort, located_with_);
  if (static_cast<int>(pass_.all.size()) < 2 * unknowns()) return std::nullopt;
  const double moved_px = move();
  Change change = take_blur(pass_.improved(fit_.blur));
  change.points_px = moved_px;
  if (!fit_.unknowns.pose().camera_from_unrolled.translation.allFinite()) return std::nullopt;
  return change;
}

bool Fitter::settle() {
  auto change = refine(capture);
  if (change && !(change->settled() && change->sharp())) change = refine(approach);
  if (!change) return false;
  for (int i = 0; i < (fit_.blur.wide() ? max_wide_passes : max_passes); ++i) {
    change = refine(measure_all);
    if (!change) return false;
    // Of a blur that has just become wide the ellipse was not asked yet.
    const bool as_wide = located_with_.wide() == fit_.blur.wide();
    if (change->settled() && change->ellipse_settled() && as_wide) break;
  }
  return change->settled();
}

bool Fitter::see_camera(const ExpectedProcessing& expected) {
  for (int i = 0; expected.ask; ++i) {
    SeenCamera camera = look_at_camera(light_, pass_.all, located_with_.boundaries_px, fit_.departure);
    fit_.processing = camera.evidence.processing;
    processed_ = std::move(camera.evidence.edges);
    fit_.processing_explained += camera.explained, fit_.asked_for_departure += camera.asked_for_departure;
    if (!camera.departure || i == most_departures) break;
    fit_.departure = *camera.departure;
    for (int k = 0; k < passes_of_departure; ++k)
      if (!refine(measure_all)) return false;
  }
  if (fit_.processing == Processing::unknown) fit_.bias_px = expected.bias_px;
  if (processed_) take_processing_off(*processed_);
  return true;
}

void Fitter::take_processing_off(const ProcessedEdges& edges) {
  fit_.bias_px = bias_magnitudes_px(edges);
  for (std::size_t i = 0; i < pass_.all.size(); ++i)
    pass_.all[i].residual_px -= static_cast<double>(edges.measurement_bias_px[i]);
  move();
}

void Fitter::judge() {
  fit_.turn = turn_blur(pass_, located_with_, fit_.processing == Processing::found);
  fit_.lines = pass_.lines;
  fit_.in_image = pass_.in_image;
  fit_.sides_in_image = pass_.sides_in_image;
  const ResidualLines lines = residual_lines(pass_.all);
  const auto print = fit_print(pass_.all, lines, unknowns(), film_prior(), scene_.marker,
                               common_errors(pass_, lines, fit_.blur, processed_, fit_.bias_px, fit_.departure));
  if (!print) return;
  fit_.unknowns = fit_.unknowns.changed_by(print->step.head(unknowns()));
  count_inliers();
  tell(*print);
}

void Fitter::count_inliers() {
  double squares = 0;
  int inliers = 0;
  for (const Measurement& m : pass_.all) {
    const double sigmas = std::abs(m.residual_px) / m.sigma_px;
    if (sigmas > inlier_sigmas) continue;
    m.group < 4 ? ++fit_.used[m.group] : ++fit_.sides_used;
    if (m.group < 4) squares += sigmas * sigmas, ++inliers;
  }
  fit_.inlier_rms_sigmas = inliers ? std::sqrt(squares / inliers) : 0;
}

void Fitter::tell(const PrintFit& print) {
  const double doubt =
      1 + fine_fit_limits.doubt_of_hidden * std::max(0.0, fine_fit_limits.usual_fraction - fit_.located_fraction());
  fit_.covariance = doubt * doubt * print.covariance;
  fit_.inner_off_m = print.inner_off_m;
  fit_.print_off_probability = print.off_probability;
  // What the print may add goes by how often prints are off, not by what this picture shows.
  fit_.psi_variance_by_print = print.psi_variance_by_print;
  fit_.psi_variance_suspected = print.psi_variance_suspected;
  fit_.suspected_probability = print.suspected_probability;
  fit_.psi_variance = doubt * doubt * (print.psi_variance - print.psi_variance_by_print) + print.psi_variance_by_print;
  fit_.psi_variance_by_tolerance = doubt * doubt * print.psi_variance_by_tolerance;
  fit_.converged = true;
}

}  // namespace

double FineFit::located_fraction() const {
  const int located = used[0] + used[1] + used[2] + used[3];
  return static_cast<double>(located) / std::max(1, in_image[0] + in_image[1] + in_image[2] + in_image[3]);
}

double doubt_scale(double sigma_px, double blur_px, double bias_px) {
  const FineFitLimits& limits = fine_fit_limits;
  return std::max(1.0, sigma_px / limits.usual_sigma_px) + std::max(0.0, blur_px - limits.usual_blur_px) +
         bias_px / limits.doubted_processing_px;
}

FineFit fit_finely(const Scene& scene, const LightImage& light, const PoseUnknowns& start, EdgeBlur blur,
                   const ExpectedProcessing& expected) {
  FineFit fit;
  fit.unknowns = start;
  fit.blur = blur;
  fit.departure = expected.departure;
  Fitter fitter(scene, light, fit);
  if (fitter.settle() && fitter.see_camera(expected)) fitter.judge();
  return fit;
}

}  // namespace lapservo::internal
