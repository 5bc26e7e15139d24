#include "lapservo/vision/model/print_fit.h"

#include <algorithm>
#include <cmath>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/vision/model/print_equations.h"
#include "lapservo/vision/model/print_evidence.h"
#include "lapservo/vision/observation.h"

namespace lapservo::internal {
namespace {

constexpr const PrintLimits& limits = print_limits;

// A size of errors beyond the tolerance, and how likely it is.
struct Hypothesis {
  PrintPrior prior;  // with the tolerance
  bool is_off = false;
  double weight = 0;
};
constexpr std::size_t hypotheses = (1 + limits.bands.size()) * (1 + limits.inks.size());
using Hypotheses = InplaceVector<Hypothesis, hypotheses>;

// The first is the rig's print. Every print's bands are off by what the rig says of them.
Hypotheses prior_hypotheses(const Marker& marker, bool is_known) {
  const double tolerance_mm = marker.boundary_sigma_m() / mm_in_m;
  const bool is_measured = marker.measured_sigma_m().has_value();
  const auto with_none = [&](std::span<const ErrorSize> sizes) {
    InplaceVector<ErrorSize, 1 + limits.bands.size()> all;
    all.push_back({0, 1});
    for (const ErrorSize& size : sizes) {
      const bool seldom = (is_known && size.mm >= limits.off_mm) || (is_measured && size.mm > tolerance_mm);
      const double fraction = seldom ? limits.fraction_of_known : size.fraction;
      all.push_back({size.mm, fraction});
      all[0].fraction -= fraction;
    }
    return all;
  };
  Hypotheses all;
  for (const ErrorSize& bands : with_none(limits.bands))
    for (const ErrorSize& ink : with_none(limits.inks))
      all.push_back({{std::hypot(bands.mm, tolerance_mm), ink.mm},
                     std::max(bands.mm, ink.mm) >= limits.off_mm,
                     bands.fraction * ink.fraction});
  return all;
}

// Weighted by how likely the residuals are; the weights add up to 1.
Hypotheses weighted(Hypotheses all, const PrintInformation& evidence) {
  std::array<double, hypotheses> gains;
  for (std::size_t i = 0; i < hypotheses; ++i) gains[i] = likelihood_gain(evidence, all[i].prior);
  const double best = *std::max_element(gains.begin(), gains.end());
  double sum = 0;
  for (std::size_t i = 0; i < hypotheses; ++i) sum += all[i].weight *= std::exp(gains[i] - best);
  for (Hypothesis& hypothesis : all) hypothesis.weight /= sum;
  return all;
}

// The frame's evidence about pose and print: the mean over all sizes of errors.
class Mixture {
 public:
  PrintSolution as_the_rig_says;
  double off_probability = 0;

  void add(const PrintSolution& solution, double weight) {
    step_ += weight * solution.step;
    print_mm_ += weight * solution.print_mm;
    squares_ += weight * (solution.covariance + solution.step * solution.step.transpose());
    weight_ += weight;
    parts_.push_back({weight, solution.step[psi_unknown], solution.covariance(psi_unknown, psi_unknown)});
  }
  UnknownVector step() const { return step_ / weight_; }
  PrintVector print_mm() const { return print_mm_ / weight_; }
  UnknownMatrix covariance() const { return squares_ / weight_ - step() * step().transpose(); }
  // That the mean of psi is wrong.
  double p_false() const {
    double sum = 0;
    for (const Part& part : parts_)
      sum += part.weight * p_false_of(part.psi_rad - step_[psi_unknown] / weight_, part.psi_variance_rad2);
    return sum / weight_;
  }

 private:
  struct Part {
    double weight, psi_rad, psi_variance_rad2;
  };
  UnknownVector step_ = UnknownVector::Zero();
  PrintVector print_mm_ = PrintVector::Zero();
  UnknownMatrix squares_ = UnknownMatrix::Zero();
  double weight_ = 0;
  InplaceVector<Part, hypotheses> parts_;
};

std::optional<Mixture> mixed(const PrintSums& sums, const Hypotheses& prior, const PrintDoubt& doubt,
                             const Marker& marker) {
  const auto as_the_rig_says = solved_with_print(sums, prior[0].prior);
  if (!as_the_rig_says) return std::nullopt;
  std::array<double, 4> weights{};
  for (std::size_t k = 0; k < weights.size(); ++k) weights[k] = sums.pulls[k].weight;
  const PrintShapes shapes_mm = shapes_of(doubt, sums.equations.nn, weights, marker);
  const Hypotheses all = weighted(prior, doubted(information_of(sums), shapes_mm));
  Mixture mixture;
  mixture.as_the_rig_says = *as_the_rig_says;
  mixture.add(*as_the_rig_says, all[0].weight);
  for (std::size_t i = 1; i < all.size(); ++i) {
    if (all[i].is_off) mixture.off_probability += all[i].weight;
    if (all[i].weight < limits.min_weight) continue;
    const auto off = solved_with_print(sums, all[i].prior);
    if (!off) return std::nullopt;
    mixture.add(*off, all[i].weight);
  }
  return mixture;
}

// By how many sigmas of both the shaft at `step` misses the RCM.
double missed_sigmas(const UnknownVector& step, const UnknownMatrix& covariance, const RcmMeasurement& rcm) {
  const Eigen::Vector2d missed = rcm.residual - rcm.rows * step;
  const Eigen::Matrix2d of_both = Eigen::Matrix2d::Identity() + rcm.rows * covariance * rcm.rows.transpose();
  return std::sqrt(std::max(0.0, missed.dot(of_both.inverse() * missed)));
}

// The same of what the image alone shows; 0 of no whole pose. Most frames show the rig's print passing the RCM.
double missed_by_image(const PrintSums& by_image, const RcmMeasurement& rcm, const Hypotheses& prior,
                       const PrintDoubt& doubt, const Marker& marker) {
  const auto free = solved_with_print(by_image, prior[0].prior);
  const double sigmas = free ? missed_sigmas(free->step, free->covariance, rcm) : 0;
  if (!(sigmas > limits.clearly_missed_sigmas)) return sigmas;
  const auto whole = mixed(by_image, prior, doubt, marker);
  return whole ? missed_sigmas(whole->step(), whole->covariance(), rcm) : 0;
}

}  // namespace

double p_false_of(double mean_rad, double variance_rad2) {
  const double scale = 1 / std::sqrt(2 * variance_rad2), limit_rad = Observation::false_rad;
  return 0.5 * (std::erfc((limit_rad - mean_rad) * scale) + std::erfc((limit_rad + mean_rad) * scale));
}

std::optional<PrintFit> fit_print(std::span<Measurement> measurements, const std::optional<RcmBesideFit>& rcm,
                                  double film_prior, const Marker& marker, bool is_known, const CommonErrors& errors) {
  const PrintSums by_image = print_sums(measurements, film_prior, errors);
  const Hypotheses prior = prior_hypotheses(marker, is_known);
  PrintFit fit;
  const bool is_proximal = rcm && rcm->measurement.is_proximal;
  fit.misses_rcm = rcm && (!is_proximal || missed_by_image(by_image, rcm->measurement, prior, errors.doubt, marker) >
                                               limits.contradicted_sigmas);
  fit.through_rcm = is_proximal && !(fit.misses_rcm && rcm->may_be_contradicted);
  const PrintSums sums = fit.through_rcm ? held(by_image, rcm->measurement) : by_image;
  const auto print = mixed(sums, prior, errors.doubt, marker);
  if (!print) return std::nullopt;
  const auto exact = prior[0].prior.bands_mm > 0 ? solved_with_print(sums, {}) : print->as_the_rig_says;
  // Where the passes ended, and the measurements were taken.
  const bool as_passes = !rcm || rcm->held_by_passes == fit.through_rcm;
  const auto settled =
      as_passes ? exact : solved_with_print(fit.through_rcm ? by_image : held(by_image, rcm->measurement), {});
  if (!exact || !settled) return std::nullopt;
  fit.step = print->step() - settled->step;
  fit.step_as_the_rig_says = print->as_the_rig_says.step - settled->step;
  for (Measurement& m : measurements) m.residual_px -= m.row.dot(fit.step) + print_shift_px(m, print->print_mm());
  fit.covariance = print->covariance().topLeftCorner<pose_unknowns, pose_unknowns>();
  if (fit.through_rcm)
    fit.by_rcm_m = (print->as_the_rig_says.inverse * rcm->measurement.rows.transpose() * rcm->measurement.by_rcm_m)
                       .topRows<pose_unknowns>();
  const auto psi_variance = [](const PrintSolution& s) { return s.covariance(psi_unknown, psi_unknown); };
  fit.off_probability = print->off_probability;
  fit.p_false = print->p_false();
  fit.p_false_by_tolerance = p_false_of(0, psi_variance(print->as_the_rig_says)) - p_false_of(0, psi_variance(*exact));
  fit.psi_variance_by_tolerance = psi_variance(print->as_the_rig_says) - psi_variance(*exact);
  return fit;
}

}  // namespace lapservo::internal
