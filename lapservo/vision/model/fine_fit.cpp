#include "lapservo/vision/model/fine_fit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>

#include "lapservo/vision/model/common_errors.h"
#include "lapservo/vision/model/normal_equations.h"
#include "lapservo/vision/model/turn_blur.h"

namespace lapservo::internal {
namespace {

constexpr int max_passes = 5, most_departures = 2, passes_of_departure = 2;

// Minimises the robust cost of linearised measurements: iteratively reweighted. `film_prior` is what the film's
// thickness lies below its expected one, in film_sigma_m.
UnknownVector solve(std::span<const Measurement> measurements, const std::optional<RcmMeasurement>& rcm,
                    double film_prior) {
  constexpr int max_iterations = 4;
  UnknownVector step = UnknownVector::Zero();
  for (int i = 0; i < max_iterations; ++i) {
    NormalEquations equations;
    equations.add(UnknownVector::Unit(film_unknown), film_prior, 1);
    for (const Measurement& m : measurements)
      equations.add(m.row, m.residual_px, robust_certainty(m.residual_px - m.row.dot(step), m.sigma_px));
    if (rcm)
      for (const int across : {0, 1}) equations.add(rcm->rows.row(across), rcm->residual[across], 1);
    const UnknownVector next = equations.solve(ridge), change = next - step;
    step = next;
    if (change.dot(equations.information() * change) < fine_fit_limits.settled_sigmas * fine_fit_limits.settled_sigmas)
      break;
  }
  return step;
}

// The changes by a pass.
struct Change {
  double points_px = 0;       // how far the farthest measured point moved
  double blur_fraction = 0;   // by how much the blur did, of what it was
  double motion_blur_px = 0;  // by how much a blur beyond a lens's did
  double oblique_px2 = 0;     // by how much a boundary's covariance along the shaft and across it did, at most

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

// For an image that looks processed, or unlike any, through the departure.
bool looks_better(const ProcessingEvidence& as_the_rig_says, const ProcessingEvidence& departed) {
  if (as_the_rig_says.processing != Processing::found) return as_the_rig_says.processing == Processing::none;
  return !departed.edges || as_the_rig_says.edges->misfit_without < departed.edges->misfit_without;
}

// One fit: passes of locating edges and moving there, a look at what the camera did, and the print.
class Fitter {
 public:
  // `fit` holds what it starts from, and the result.
  Fitter(const Scene& scene, const LightImage& light, FineFit& fit) : scene_(scene), light_(light), fit_(fit) {}
  // Each returns whether to go on; what is known by then is in the result.
  bool settle() {
    auto change = refine(capture);
    if (change && !(change->settled() && change->sharp())) change = refine(approach);
    return change && refine_until_settled(1);
  }
  bool see_camera(const Expected& expected) {
    const bool is_blurred_otherwise =
        expected.blur &&
        std::abs(fit_.blur.boundaries_px() / expected.blur->boundaries_px() - 1) > fine_fit_limits.other_blur;
    fit_.asked = fit_.asked || expected.ask || is_blurred_otherwise;  // also after other passes
    for (int i = 0; fit_.asked; ++i) {
      const CameraDeparture departure = look_at_camera();
      const bool as_known = departure.moves_alike(fit_.departure);
      if (as_known || i < most_departures) fit_.departure = departure;
      if (as_known || i == most_departures) break;
      if (!refine_until_settled(passes_of_departure)) return false;
    }
    if (fit_.processing == Processing::unknown) fit_.bias_px = expected.bias_px;
    if (processed_) take_processing_off(*processed_);
    return true;
  }
  void judge(const Expected& expected) {
    static_cast<PlacesLookedAt&>(fit_) = pass_;
    const auto tau_rad = facing_tau_rad(scene_.marker, fit_.unknowns.pose());
    const bool is_known = tau_rad && scene_.known_sides[print_side(*tau_rad)];
    count_inliers();
    std::optional<RcmBesideFit> beside;
    if (const auto measurement = rcm())
      beside = RcmBesideFit{*measurement, fit_.unknowns.through_rcm(), fit_.is_well_seen()};
    const auto print = fit_print(pass_.all, beside, film_prior(), scene_.marker, is_known, errors());
    if (!print) return;
    settled_ = fit_.unknowns;
    fit_.unknowns = fit_.unknowns.with_rcm(print->through_rcm);
    fit_.as_the_rig_says = fit_.unknowns.changed_by(print->step_as_the_rig_says.head<pose_unknowns>());
    fit_.unknowns = fit_.unknowns.changed_by(print->step.head<pose_unknowns>());
    count_inliers();
    tell(*print);
    count_turn(expected);
  }
  bool settles_by_rcm() {
    const bool through_rcm = fit_.unknowns.through_rcm();
    if (!fit_.converged || settled_.through_rcm() == through_rcm) return false;
    fit_.unknowns = settled_.with_rcm(through_rcm);
    fit_.converged = false;
    return refine_until_settled(1);
  }

 private:
  static constexpr Effort capture{5, 5, 3, 3}, approach{4, 4, 6, 3}, measure_all{2, 0, 1, 1};

  // Present when the scene has a registration.
  std::optional<RcmMeasurement> rcm() const {
    if (!scene_.registration) return std::nullopt;
    return scene_.registration->of(fit_.unknowns.pose(), fine_fit_limits.least_rcm_sigma_m);
  }
  double film_prior() const { return (film_mean_m - film_m_) / film_sigma_m; }
  double move() {
    const UnknownVector step = solve(pass_.all, fit_.unknowns.through_rcm() ? rcm() : std::nullopt, film_prior());
    double farthest_px = 0;
    for (Measurement& m : pass_.all) {
      const double shift_px = m.row.dot(step);
      m.residual_px -= shift_px;
      m.expected_px += static_cast<float>(shift_px) * m.normal;
      farthest_px = std::max(farthest_px, std::abs(shift_px));
    }
    fit_.unknowns = fit_.unknowns.changed_by(step.head<pose_unknowns>());
    film_m_ = std::clamp(film_m_ + step[film_unknown] * film_sigma_m, 0.0, film_mean_m + 4 * film_sigma_m);
    return farthest_px;
  }
  Change take_blur(const EdgeBlur& improved) {
    Change change;
    const EdgeBlur& before = fit_.blur;
    for (std::size_t k = 0; k < 4; ++k) {
      change.add_blur(before.along_px[k], improved.along_px[k]);
      const double oblique_px2 = improved.ellipse(k).oblique_px2 - before.ellipse(k).oblique_px2;
      change.oblique_px2 = std::max(change.oblique_px2, std::abs(oblique_px2));
    }
    change.add_blur(before.sides_px, improved.sides_px);
    fit_.blur = improved;
    return change;
  }
  std::optional<Change> refine(const Effort& effort) {
    ++fit_.passes;
    located_with_ = fit_.blur;
    const DepartedLight seen(light_, fit_.departure);
    pass_ = measure_edges(scene_, seen.light(), fit_.unknowns, film_m_, effort, located_with_);
    const int unheld = fit_.unknowns.through_rcm() ? pose_unknowns - 2 : pose_unknowns;
    if (static_cast<int>(pass_.all.size()) < 2 * unheld) return std::nullopt;
    const double moved_px = move();
    Change change = take_blur(pass_.improved(fit_.blur));
    change.points_px = moved_px;
    if (!fit_.unknowns.pose().camera_from_unrolled.translation.allFinite()) return std::nullopt;
    return change;
  }
  bool refine_until_settled(int least_passes) {
    bool settled = false;
    for (int i = 1; i <= max_passes; ++i) {
      const auto change = refine(measure_all);
      if (!change) return false;
      settled = change->settled();
      if (i >= least_passes && settled && change->ellipse_settled()) break;
    }
    return settled;
  }
  ProcessingEvidence processing_in(const LightImage& light) {
    ProcessingEvidence evidence = find_processing(light, pass_.all, located_with_.boundaries_px());
    fit_.processing_explained += evidence.explained;
    return evidence;
  }
  // The camera's departure from the rig's, as far as it is known by its processing of the image as that looks when the
  // known one is undone. One is accepted if the image looks unprocessed without it: processing moves channels apart,
  // too. One that an earlier frame showed is withdrawn by an image that looks better with it in.
  CameraDeparture look_at_camera() {
    const CameraDeparture known = fit_.departure;
    fit_.processing = Processing::unknown, processed_.reset();
    if (located_with_.boundaries_px() > processing_limits.max_blur_px) return known;
    const DepartedLight seen(light_, known);
    ProcessingEvidence evidence = processing_in(seen.light());
    fit_.processing = evidence.processing;
    const bool is_withdrawn =
        fit_.processing != Processing::none && known.any() && looks_better(processing_in(light_), evidence);
    processed_ = std::move(evidence.edges);
    if (is_withdrawn) return {};
    if (fit_.processing == Processing::found) return known;
    ++fit_.asked_for_departure;
    const auto more = find_departure(seen.light(), pass_.all, located_with_.boundaries_px());
    if (!more) return known.any() ? known : CameraDeparture{};  // what was uncertain is certain, where channels agree
    const auto all = known.then(*more);
    if (!all || !more->any()) return all.value_or(known);
    const DepartedLight without(light_, *all);
    return processing_in(without.light()).processing == Processing::none ? *all : known;
  }
  void take_processing_off(const ProcessedEdges& edges) {
    fit_.bias_px = magnitudes_px(edges.bias_px);
    for (std::size_t i = 0; i < pass_.all.size(); ++i)
      pass_.all[i].residual_px -= static_cast<double>(edges.measurement_bias_px[i]);
    move();
  }
  void count_turn(const Expected& expected) {
    const TurnBlur turn = turn_blur(pass_, located_with_, fit_.processing == Processing::found);
    const auto change_rad =
        expected.moved_on ? std::optional(expected.moved_on->change_to(fit_.unknowns)[psi_unknown]) : std::nullopt;
    fit_.covariance(psi_unknown, psi_unknown) += variance_of_uneven_turn(turn, change_rad);
    fit_.p_false = std::max(fit_.p_false, p_false_of(0, fit_.psi_variance_rad2()));
  }
  CommonErrors errors() const {
    CommonErrors errors = common_errors(pass_, fit_.blur, processed_, fit_.bias_px, departure_px());
    if (!has_sigmas(scene_.camera, scene_.marker)) return errors;
    std::array<double, 4> by_exponent_px{};
    // An exponent that the image shows has a sigma of its own.
    if (scene_.camera.response.sigma && fit_.departure.exponent == 1) {
      const DepartedLight seen(light_, fit_.departure);
      by_exponent_px = moved_by_exponent_px(seen.light(), pass_.all, located_with_.boundaries_px());
    }
    errors.rig = RigErrors(scene_.camera, scene_.marker, fit_.unknowns.pose(), by_exponent_px);
    return errors;
  }
  std::array<double, 4> departure_px() const {
    std::array<double, 4> radial_px{}, doubt_px{};
    const Eigen::Vector2f centre = light_.channels().centre();
    std::array<int, 4> places{};
    for (const Measurement& m : pass_.all)
      if (m.group < 4)
        radial_px[m.group] += static_cast<double>((m.expected_px - centre).dot(m.normal)), ++places[m.group];
    for (std::size_t k = 0; k < 4; ++k) doubt_px[k] = fit_.departure.doubt_px(k, radial_px[k] / std::max(1, places[k]));
    return doubt_px;
  }
  void count_inliers() {
    fit_.used.fill(0), fit_.sides_used = 0;
    double squares = 0;
    for (const Measurement& m : pass_.all) {
      const double sigmas = std::abs(m.residual_px) / std::hypot(m.sigma_px, fine_fit_limits.tolerated_px);
      if (sigmas > inlier_sigmas) continue;
      m.group < 4 ? ++fit_.used[m.group] : ++fit_.sides_used;
      if (m.group < 4) squares += sigmas * sigmas;
    }
    const int inliers = fit_.used[0] + fit_.used[1] + fit_.used[2] + fit_.used[3];
    fit_.inlier_rms_sigmas = inliers ? std::sqrt(squares / inliers) : 0;
  }
  void tell(const PrintFit& print) {
    if (scene_.registration) fit_.with_registration = print.by_rcm_m * scene_.registration->covariance.topRows<3>();
    static_cast<PrintVerdict&>(fit_) = print;
    fit_.converged = true;
  }

  const Scene& scene_;
  const LightImage& light_;
  FineFit& fit_;
  double film_m_ = film_mean_m;
  PoseUnknowns settled_;  // of the passes, before the print is known
  EdgeMeasurements pass_;
  EdgeBlur located_with_;
  std::optional<ProcessedEdges> processed_;
};

}  // namespace

double FineFit::misfit() const {
  const double located = located_fraction();
  return located * inlier_rms_sigmas * inlier_rms_sigmas + (1 - located) * inlier_sigmas * inlier_sigmas;
}

double FineFit::located_fraction() const {
  const int located = used[0] + used[1] + used[2] + used[3];
  return static_cast<double>(located) / std::max(1, in_image[0] + in_image[1] + in_image[2] + in_image[3]);
}

FineFit FineFit::at_frame() const {
  FineFit fit = *this;
  fit.unknowns = unknowns.changed_by(motion.to_frame());
  if (const auto& sigma = motion.to_frame_sigma()) fit.covariance.diagonal() += sigma->cwiseAbs2();
  return fit;
}

FineFit fit_finely(const Scene& scene, const LightImage& light, const PoseUnknowns& start, const Expected& expected) {
  FineFit fit;
  fit.unknowns = start;
  fit.blur = expected.blur.value_or(EdgeBlur());
  fit.departure = expected.departure;
  Fitter fitter(scene, light, fit);
  if (!fitter.settle() || !fitter.see_camera(expected)) return fit;
  fitter.judge(expected);
  if (fitter.settles_by_rcm() && fitter.see_camera(expected)) fitter.judge(expected);
  fit.motion = scene.motion_at(fit.unknowns);
  return fit;
}

}  // namespace lapservo::internal
