#include "lapservo/vision/model/print_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/vision/model/print_equations.h"
#include "lapservo/vision/model/print_evidence.h"
#include "lapservo/vision/observation.h"

namespace lapservo::internal {
namespace {

constexpr const PrintLimits& limits = print_limits;

PrintShapes doubted_shapes_mm(const PrintDoubt& doubt, const PrintSums& sums, const Marker& marker) {
  std::array<double, 4> weights{};
  for (std::size_t k = 0; k < weights.size(); ++k) weights[k] = sums.pulls[k].weight;
  return shapes_of(doubt, sums.equations.nn, weights, marker);
}

// A size of errors beyond the tolerance, and how likely it is.
struct Hypothesis {
  PrintPrior prior;  // with the tolerance
  bool is_off = false;
  double weight = 0;
};
constexpr std::size_t hypotheses = (1 + limits.bands.size()) * (1 + limits.inks.size());
using Hypotheses = InplaceVector<Hypothesis, hypotheses>;

// The first is the rig's print. Every print's bands are off by the tolerance.
Hypotheses prior_hypotheses(double tolerance_mm, bool is_known) {
  const auto fraction_of = [&](const ErrorSize& size) {
    return is_known && size.mm >= limits.off_mm ? limits.fraction_of_known : size.fraction;
  };
  const auto right = [&](const auto& sizes) {
    double fraction = 1;
    for (const ErrorSize& size : sizes) fraction -= fraction_of(size);
    return fraction;
  };
  const double ink_right = right(limits.inks);
  Hypotheses all;
  const auto add = [&](double bands_mm, double ink_mm, double weight) {
    all.push_back({{std::hypot(bands_mm, tolerance_mm), ink_mm}, std::max(bands_mm, ink_mm) >= limits.off_mm, weight});
  };
  const auto add_inks = [&](double bands_mm, double weight) {
    add(bands_mm, 0, weight * ink_right);
    for (const ErrorSize& ink : limits.inks) add(bands_mm, ink.mm, weight * fraction_of(ink));
  };
  add_inks(0, right(limits.bands));
  for (const ErrorSize& bands : limits.bands) add_inks(bands.mm, fraction_of(bands));
  return all;
}

// Weighted by how likely the residuals are; the weights add up to 1.
Hypotheses weighted(Hypotheses all, const PrintInformation& evidence) {
  const PrintEvidence of(evidence);
  std::array<double, hypotheses> gains;
  for (std::size_t i = 0; i < hypotheses; ++i) gains[i] = of.gain(all[i].prior);
  const double best = *std::max_element(gains.begin(), gains.end());
  double sum = 0;
  for (std::size_t i = 0; i < hypotheses; ++i) sum += all[i].weight *= std::exp(gains[i] - best);
  for (Hypothesis& hypothesis : all) hypothesis.weight /= sum;
  return all;
}

// Weighted solutions as one.
class Mixture {
 public:
  explicit Mixture(int unknowns)
      : step_(UnknownVector::Zero(unknowns)), squares_(UnknownMatrix::Zero(unknowns, unknowns)), psi_(unknowns - 2) {}
  void add(const PrintSolution& solution, double weight) {
    step_ += weight * solution.step;
    print_mm_ += weight * solution.print_mm;
    squares_ += weight * (solution.covariance + solution.step * solution.step.transpose());
    weight_ += weight;
    parts_.push_back({weight, solution.step[psi_], solution.covariance(psi_, psi_)});
  }
  PrintSolution mean() const {
    const UnknownVector step = step_ / weight_;
    return {step, print_mm_ / weight_, squares_ / weight_ - step * step.transpose()};
  }
  // That the mean of psi is wrong.
  double p_false() const {
    double sum = 0;
    for (const Part& part : parts_)
      sum += part.weight * p_false_of(part.psi_rad - step_[psi_] / weight_, part.psi_variance_rad2);
    return sum / weight_;
  }

 private:
  struct Part {
    double weight, psi_rad, psi_variance_rad2;
  };
  UnknownVector step_;
  PrintVector print_mm_ = PrintVector::Zero();
  UnknownMatrix squares_;
  Eigen::Index psi_;
  double weight_ = 0;
  InplaceVector<Part, hypotheses> parts_;
};

std::optional<Mixture> mixed(const PrintSums& sums, const PrintSolution& as_the_rig_says, const Hypotheses& all) {
  Mixture mixture(static_cast<int>(as_the_rig_says.step.size()));
  mixture.add(as_the_rig_says, all[0].weight);
  for (std::size_t i = 1; i < all.size(); ++i) {
    if (all[i].weight < limits.min_weight) continue;
    const auto off = solved_with_print(sums, all[i].prior);
    if (!off) return std::nullopt;
    mixture.add(*off, all[i].weight);
  }
  return mixture;
}

double off_probability(const Hypotheses& all) {
  double sum = 0;
  for (const Hypothesis& hypothesis : all)
    if (hypothesis.is_off) sum += hypothesis.weight;
  return sum;
}

}  // namespace

double p_false_of(double mean_rad, double variance_rad2) {
  const double scale = 1 / std::sqrt(2 * variance_rad2), limit_rad = Observation::false_rad;
  return 0.5 * (std::erfc((limit_rad - mean_rad) * scale) + std::erfc((limit_rad + mean_rad) * scale));
}

std::optional<PrintFit> fit_print(std::span<Measurement> measurements, const ResidualLines& lines, int pose_unknowns,
                                  double film_prior, const Marker& marker, bool is_known, const CommonErrors& errors) {
  const PrintSums sums = print_sums(measurements, lines, pose_unknowns, film_prior, errors);
  const double tolerance_mm = marker.tolerance_m / mm_in_m;
  const auto as_the_rig_says = solved_with_print(sums, {tolerance_mm});
  const auto exact = tolerance_mm > 0 ? solved_with_print(sums, {}) : as_the_rig_says;
  if (!exact || !as_the_rig_says) return std::nullopt;
  // Nothing, where the frame tells nothing of the print.
  const PrintInformation print = information_of(sums).value_or(PrintInformation{});
  const PrintInformation evidence = doubted(print, doubted_shapes_mm(errors.doubt, sums, marker));
  const Hypotheses all = weighted(prior_hypotheses(tolerance_mm, is_known || marker.bands_are_measured()), evidence);
  const auto mixture = mixed(sums, *as_the_rig_says, all);
  if (!mixture) return std::nullopt;
  PrintSolution mean = mixture->mean();
  mean.step -= exact->step;  // whose pose is where the measurements were taken
  for (Measurement& m : measurements) m.residual_px -= m.row.dot(mean.step) + print_shift_px(m, mean.print_mm);
  const auto psi_variance = [psi = pose_unknowns - 1](const PrintSolution& solution) {
    return solution.covariance(psi, psi);
  };
  const double tolerated_rad2 = psi_variance(*as_the_rig_says);
  PrintFit fit;
  fit.step = mean.step;
  fit.step_as_the_rig_says = as_the_rig_says->step - exact->step;
  fit.covariance = mean.covariance.topLeftCorner(pose_unknowns, pose_unknowns);
  fit.off_probability = off_probability(all);
  fit.p_false = mixture->p_false();
  fit.p_false_by_tolerance = p_false_of(0, tolerated_rad2);
  fit.psi_variance_by_tolerance = tolerated_rad2 - psi_variance(*exact);
  return fit;
}

}  // namespace lapservo::internal
