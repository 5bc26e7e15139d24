#include "lapservo/vision/model/print_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>

#include "lapservo/vision/model/print_equations.h"
#include "lapservo/vision/model/print_evidence.h"

namespace lapservo::internal {
namespace {

constexpr auto& print_sigmas_mm = print_limits.sigmas_mm;

// How far one of the inner boundaries may lie off as a whole: what the residuals say, and some sigmas more.
double inner_off_mm(const PrintInformation& print, double doubt_scale) {
  double off_mm = 0;
  for (const int at : {1, 3}) {
    const double certainty = std::max(print.information.block<2, 2>(at, at).sum(), 1e-6);
    const double shift_mm = print.gradient.segment<2>(at).sum() / certainty;
    const double here_mm = std::abs(shift_mm) + print_limits.off_sigmas * doubt_scale / std::sqrt(certainty);
    if (!std::isfinite(here_mm)) return 1e3;
    off_mm = std::max(off_mm, here_mm);
  }
  return off_mm;
}

PrintShapes doubted_shapes_mm(const PrintDoubt& doubt, const PrintSums& sums, const Marker& marker) {
  std::array<double, 4> weights{};
  for (std::size_t k = 0; k < weights.size(); ++k) weights[k] = sums.pulls[k].weight;
  return shapes_of(doubt, sums.equations.nn, weights, marker);
}

// Weighted solutions as one.
class Mixture {
 public:
  explicit Mixture(int unknowns)
      : step_(UnknownVector::Zero(unknowns)), squares_(UnknownMatrix::Zero(unknowns, unknowns)) {}
  void add(const PrintSolution& solution, double weight) {
    step_ += weight * solution.step;
    print_mm_ += weight * solution.print_mm;
    squares_ += weight * (solution.covariance + solution.step * solution.step.transpose());
    weight_ += weight;
  }
  PrintSolution mean() const {
    const UnknownVector step = step_ / weight_;
    return {step, print_mm_ / weight_, about(step)};
  }
  // Mean square of what lies beside that step.
  UnknownMatrix about(const UnknownVector& step) const {
    const UnknownVector mean = step_ / weight_, beside = mean - step;
    return squares_ / weight_ - mean * mean.transpose() + beside * beside.transpose();
  }

 private:
  UnknownVector step_;
  PrintVector print_mm_ = PrintVector::Zero();
  UnknownMatrix squares_;
  double weight_ = 0;
};

constexpr std::size_t sizes = print_sigmas_mm.size();
using Weights = std::array<double, sizes + 1>;  // of the tolerated print, and of those that are off by print_sigmas_mm

// Of a print that is off by this size and the tolerance.
PrintPrior prior_of(std::size_t size, double tolerance_mm) {
  return {std::hypot(print_sigmas_mm[size], tolerance_mm), print_sigmas_mm[size] >= print_limits.least_ink_aside_mm};
}

// The largest 1.
Weights likelihoods_of(const PrintInformation& print, double tolerance_mm) {
  const PrintEvidence evidence(print);
  Weights gains{evidence.gain({tolerance_mm})};
  for (std::size_t i = 0; i < sizes; ++i) gains[i + 1] = evidence.gain(prior_of(i, tolerance_mm));
  const double best = *std::max_element(gains.begin(), gains.end());
  for (double& gain : gains) gain = std::exp(gain - best);
  return gains;
}

// `fractions`: how often prints are off by print_sigmas_mm.
Weights weights_of(const Weights& likelihoods, const std::array<double, sizes>& fractions) {
  Weights weights{(1 - std::accumulate(fractions.begin(), fractions.end(), 0.0)) * likelihoods[0]};
  for (std::size_t i = 0; i < sizes; ++i) weights[i + 1] = fractions[i] * likelihoods[i + 1];
  return weights;
}

double off_probability(const Weights& weights) {
  return 1 - weights[0] / std::accumulate(weights.begin(), weights.end(), 0.0);
}

// That it is off by far_off_mm and more.
double far_off(const Weights& weights) {
  double far = 0;
  for (std::size_t i = 0; i < sizes; ++i)
    if (print_sigmas_mm[i] >= print_limits.far_off_mm) far += weights[i + 1];
  return far / std::accumulate(weights.begin(), weights.end(), 0.0);
}

// Solutions for a print as the rig says, exactly and but for its tolerance.
struct AsTheRigSays {
  PrintSolution exact, tolerated;
};

std::optional<AsTheRigSays> solved_as_the_rig_says(const PrintSums& sums, double tolerance_mm) {
  const auto exact = solved_with_print(sums, {});
  if (!exact) return std::nullopt;
  AsTheRigSays out{*exact, *exact};
  // The exact print's pose is where the measurements were taken.
  if (tolerance_mm == 0) {
    out.tolerated.step.setZero(), out.tolerated.print_mm.setZero();
    return out;
  }
  const auto tolerated = solved_with_print(sums, {tolerance_mm});
  if (!tolerated) return std::nullopt;
  out.tolerated = *tolerated;
  return out;
}

// How likely each size is, by what is believed of prints when a frame is judged and suspected (PrintLimits).
struct Beliefs {
  Weights judged, suspected;
  double far_off_probability = 1;
  bool suspicious = false;

  Beliefs(const PrintInformation& evidence, const Marker& marker) {
    const double tolerance_mm = marker.tolerance_m / mm_in_m;
    const Weights likelihoods = likelihoods_of(evidence, tolerance_mm);
    judged = weights_of(likelihoods, print_limits.fractions);
    suspected = weights_of(likelihoods, print_limits.suspected_fractions);
    far_off_probability = far_off(suspected);
    if (marker.bands_are_measured() || far_off_probability < print_limits.suspicious) return;
    const PrintInformation of_exact{evidence.information, PrintVector::Zero()};
    const Weights usual = weights_of(likelihoods_of(of_exact, tolerance_mm), print_limits.suspected_fractions);
    suspicious = far_off_probability > print_limits.suspicious_of_usual * far_off(usual);
  }
  bool counts(std::size_t at) const {
    return judged[at] >= print_limits.min_weight || (suspicious && suspected[at] >= print_limits.min_suspected_weight);
  }
};

// The pose, whatever the print is, by each of these.
struct Mixtures {
  Mixture judged, suspected;

  explicit Mixtures(int pose_unknowns) : judged(pose_unknowns + 1), suspected(pose_unknowns + 1) {}
  void add(const PrintSolution& solution, const Beliefs& beliefs, std::size_t at) {
    judged.add(solution, beliefs.judged[at]);
    if (beliefs.suspicious) suspected.add(solution, beliefs.suspected[at]);
  }
};

std::optional<Mixtures> mixed(const PrintSums& sums, const AsTheRigSays& as_the_rig_says, const Beliefs& beliefs,
                              int pose_unknowns, double tolerance_mm) {
  Mixtures mixtures(pose_unknowns);
  mixtures.add(as_the_rig_says.tolerated, beliefs, 0);
  for (std::size_t i = 0; i < sizes; ++i) {
    if (!beliefs.counts(i + 1)) continue;
    const auto off = solved_with_print(sums, prior_of(i, tolerance_mm));
    if (!off) return std::nullopt;
    mixtures.add(*off, beliefs, i + 1);
  }
  return mixtures;
}

PrintFit print_fit_of(const AsTheRigSays& as_the_rig_says, const Beliefs& beliefs, const Mixtures& mixtures,
                      const PrintSolution& mean, int pose_unknowns) {
  const int psi = pose_unknowns - 1;
  const double judged = mean.covariance(psi, psi), tolerated = as_the_rig_says.tolerated.covariance(psi, psi);
  PrintFit fit;
  fit.step = mean.step;
  fit.off_probability = off_probability(beliefs.judged);
  fit.covariance = mean.covariance.topLeftCorner(pose_unknowns, pose_unknowns);
  fit.far_off_probability = beliefs.far_off_probability;
  if (beliefs.suspicious) {
    const double suspected = mixtures.suspected.about(mean.step)(psi, psi);
    fit.psi_variance_suspected = suspected - tolerated;
    const double widened = std::max(1.0, print_limits.suspected_told * std::sqrt(suspected / judged));
    fit.covariance.row(psi) *= widened, fit.covariance.col(psi) *= widened;
  }
  fit.psi_variance = judged;
  fit.psi_variance_by_print = judged - tolerated;
  fit.psi_variance_by_tolerance = tolerated - as_the_rig_says.exact.covariance(psi, psi);
  return fit;
}

}  // namespace

std::optional<PrintFit> fit_print(std::span<Measurement> measurements, const ResidualLines& lines, int pose_unknowns,
                                  double film_prior, const Marker& marker, const CommonErrors& errors) {
  const PrintSums sums = print_sums(measurements, lines, pose_unknowns, film_prior, errors);
  const double tolerance_mm = marker.tolerance_m / mm_in_m;
  const auto as_the_rig_says = solved_as_the_rig_says(sums, tolerance_mm);
  if (!as_the_rig_says) return std::nullopt;
  // Nothing, where the frame tells nothing of the print.
  const PrintInformation print = information_of(sums).value_or(PrintInformation{});
  const PrintInformation evidence = doubted(print, doubted_shapes_mm(errors.doubt, sums, marker));
  const Beliefs beliefs(evidence, marker);
  const auto mixtures = mixed(sums, *as_the_rig_says, beliefs, pose_unknowns, tolerance_mm);
  if (!mixtures) return std::nullopt;
  const PrintSolution mean = mixtures->judged.mean();
  for (Measurement& m : measurements) m.residual_px -= m.row.dot(mean.step) + print_shift_px(m, mean.print_mm);
  PrintFit fit = print_fit_of(*as_the_rig_says, beliefs, *mixtures, mean, pose_unknowns);
  fit.inner_off_m = inner_off_mm(print, errors.inner_doubt_scale) * mm_in_m;
  return fit;
}

}  // namespace lapservo::internal
