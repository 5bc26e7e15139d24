#include "lapservo/vision/print_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <utility>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/core/median.h"
#include "lapservo/vision/limits.h"
#include "lapservo/vision/normal_equations.h"
#include "lapservo/vision/print_evidence.h"

namespace lapservo::internal {
namespace {

constexpr auto& print_sigmas_mm = print_limits.sigmas_mm;
constexpr double mm = 1e-3;  // the print's errors are in millimetres here

using CrossMatrix = Eigen::Matrix<double, print_errors, Eigen::Dynamic, 0, print_errors, max_unknowns>;

// A measurement of a group whose residuals are fitted by a line: along the shaft in metres, a side's in pixels.
struct LinePoint {
  double value, turn_fraction, sigma;
};

// Robust: from the median on, reweighted. A boundary that lies elsewhere as a whole is no outlier to itself; one with
// few points is compared with the others, about zero.
ResidualLine line_of(std::span<const Measurement> measurements, std::size_t group) {
  constexpr int iterations = 4;
  constexpr std::size_t fewest = 8;
  constexpr double usual_slope = 1 * mm;  // a turn
  InplaceVector<LinePoint, EdgeMeasurements::max_lines> points;
  InplaceVector<double, EdgeMeasurements::max_lines> values;
  for (const Measurement& m : measurements) {
    if (m.group != group) continue;
    const double unit = group < 4 ? m.along_px_per_m : 1;
    const double value = m.residual_px / unit;
    points.push_back({value, group < 4 ? m.turn_fraction : 0, m.sigma_px / std::abs(unit)});
    values.push_back(value);
  }
  if (values.size() < fewest) return {};
  ResidualLine line{median(values), 0};
  for (int i = 0; i < iterations; ++i) {
    double sum = 0, turns = 0, turns_squared = 1 / (usual_slope * usual_slope), at_start = 0, at_turn = 0;
    for (const LinePoint& p : points) {
      const double sigmas = (p.value - line.at_start - line.slope * p.turn_fraction) / p.sigma;
      const double weight = cauchy_weight(sigmas, cauchy_scale_sigmas) / (p.sigma * p.sigma);
      sum += weight;
      turns += weight * p.turn_fraction;
      turns_squared += weight * p.turn_fraction * p.turn_fraction;
      at_start += weight * p.value;
      at_turn += weight * p.turn_fraction * p.value;
    }
    const double determinant = sum * turns_squared - turns * turns;
    line = {(turns_squared * at_start - turns * at_turn) / determinant,
            (sum * at_turn - turns * at_start) / determinant};
  }
  return line;
}

// d(residual)/d(print's errors at its upper and at its lower edge) [px/mm].
Eigen::Vector2d print_row(const Measurement& m) {
  const double along = mm * m.along_px_per_m;
  return {along * (1 - m.turn_fraction), along * m.turn_fraction};
}

double print_shift_px(const Measurement& m, const PrintVector& print_mm) {
  if (m.group >= errors_of_boundary.size()) return 0;
  const auto& errors = errors_of_boundary[m.group];
  return print_row(m).dot(Eigen::Vector2d(print_mm[errors[0]], print_mm[errors[1]]));
}

// Normal equations of the pose and film (x) and of the print's errors (n).
struct Equations {
  UnknownMatrix xx;
  CrossMatrix nx;
  PrintMatrix nn = PrintMatrix::Zero();
  UnknownVector x;
  PrintVector n = PrintVector::Zero();

  explicit Equations(int unknowns)
      : xx(UnknownMatrix::Zero(unknowns, unknowns)),
        nx(CrossMatrix::Zero(print_errors, unknowns)),
        x(UnknownVector::Zero(unknowns)) {}

  // Adds weight * row * row^T, and of the residual.
  void add(const UnknownVector& row_x, const PrintVector& row_n, double weight, double residual) {
    const UnknownVector weighted_x = weight * row_x;
    const PrintVector weighted_n = weight * row_n;
    xx.noalias() += row_x * weighted_x.transpose();
    nx.noalias() += weighted_n * row_x.transpose();
    nn.noalias() += row_n * weighted_n.transpose();
    x += residual * weighted_x;
    n += residual * weighted_n;
  }
};

// What a group of measurements says together: sums of weighted rows and residuals.
struct Pull {
  UnknownVector x;
  PrintVector n = PrintVector::Zero();
  double weight = 0, residual = 0, error_px = 0, told_px = 0;
};

struct Sums {
  Equations equations;
  UnknownMatrix of_boundaries;  // what boundaries alone say about pose and film
  std::array<Pull, measurement_groups> pulls;
  InplaceVector<Pull, 2> of_all_boundaries;
};

// Sums over a group of the weighted products of: the row of pose and film, that of the print's errors at its two
// edges, the residual, and 1. Of fixed size, which is several times faster; symmetric, of which the lower half is
// summed.
template <int Unknowns>
class Products {
 public:
  static constexpr int at_print = Unknowns, at_residual = at_print + 2, at_one = at_print + 3;

  void add(const Measurement& m, double weight) {
    Row row = Row::Zero();
    row.template head<Unknowns>() = m.row.head<Unknowns>();
    row.template segment<2>(at_print) = print_row(m);
    row[at_residual] = m.residual_px;
    row[at_one] = 1;
    add_columns(row, weight, std::make_integer_sequence<int, at_one + 1>());
  }
  Eigen::Matrix<double, Unknowns, Unknowns> xx() const {
    return sums_.template topLeftCorner<Unknowns, Unknowns>().template selfadjointView<Eigen::Lower>();
  }
  auto x(int by) const { return sums_.row(by).template head<Unknowns>(); }
  auto nx(int edge) const { return x(at_print + edge); }
  double nn(int edge, int other) const {
    return sums_(at_print + std::max(edge, other), at_print + std::min(edge, other));
  }
  double n(int by, int edge) const { return sums_(by, at_print + edge); }
  double weight() const { return sums_(at_one, at_one); }
  double residual() const { return sums_(at_one, at_residual); }

 private:
  static constexpr int size = at_one + 1 + (at_one + 1) % 2;  // a whole number of registers
  using Row = Eigen::Matrix<double, size, 1>;

  template <int... Columns>
  void add_columns(const Row& row, double weight, std::integer_sequence<int, Columns...>) {
    (add_column<Columns>(row, weight), ...);
  }
  template <int Column>
  void add_column(const Row& row, double weight) {
    constexpr int count = size - (Column - Column % 2);  // from a register's first on
    sums_.col(Column).template tail<count>() += (weight * row[Column]) * row.template tail<count>();
  }

  Eigen::Matrix<double, size, size> sums_ = Eigen::Matrix<double, size, size>::Zero();
};

// Adds a group's products to the sums of all, and tells its pull.
template <int Unknowns>
Pull gathered(const Products<Unknowns>& products, std::size_t group, Equations& all) {
  using Of = Products<Unknowns>;
  Pull pull;
  pull.x = products.x(Of::at_one);
  pull.weight = products.weight();
  pull.residual = products.residual();
  all.xx += products.xx();
  all.x += products.x(Of::at_residual).transpose();
  if (group >= errors_of_boundary.size()) return pull;
  const auto& errors = errors_of_boundary[group];
  for (const int edge : {0, 1}) {
    const int error = errors[static_cast<std::size_t>(edge)];
    all.nx.row(error) += products.nx(edge);
    for (const int other : {0, 1}) all.nn(error, errors[static_cast<std::size_t>(other)]) += products.nn(edge, other);
    all.n[error] += products.n(Of::at_residual, edge);
    pull.n[error] += products.n(Of::at_one, edge);
  }
  return pull;
}

double robust_certainty(const Measurement& m, const ResidualLines& lines, double certainty) {
  const double sigmas = lines[m.group].residual_px(m) / m.sigma_px;
  return certainty * cauchy_weight(sigmas, cauchy_scale_sigmas) / (m.sigma_px * m.sigma_px);
}

// All boundaries moved alike, or leaning alike.
void add_pulls_of_all(std::span<const Measurement> measurements, const ResidualLines& lines, double certainty,
                      const CommonErrors& errors, Sums& sums) {
  const auto unknowns = sums.equations.x.size();
  Pull whole, leaning;
  whole.x = leaning.x = UnknownVector::Zero(unknowns);
  double squares = 0;
  for (const Measurement& m : measurements) {
    if (m.group >= errors_of_boundary.size()) continue;
    const double weight = robust_certainty(m, lines, certainty);
    const auto& edges = errors_of_boundary[m.group];
    const Eigen::Vector2d by_print = print_row(m);
    whole.x += weight * m.row.head(unknowns);
    leaning.x += weight * m.across * m.row.head(unknowns);
    for (std::size_t edge = 0; edge < 2; ++edge) {
      whole.n[edges[edge]] += weight * by_print[static_cast<Eigen::Index>(edge)];
      leaning.n[edges[edge]] += weight * m.across * by_print[static_cast<Eigen::Index>(edge)];
    }
    whole.weight += weight, squares += weight * m.across * m.across;
  }
  if (!(squares > 0)) return;
  const double scale = std::sqrt(1 / certainty);
  whole.error_px = whole.told_px = scale * errors.whole_px;
  leaning.error_px = leaning.told_px = scale * errors.leaning_px * std::sqrt(whole.weight / squares);
  sums.of_all_boundaries.push_back(whole), sums.of_all_boundaries.push_back(leaning);
}

template <int Unknowns>
Sums sums_of(std::span<const Measurement> measurements, const ResidualLines& lines, double film_prior,
             const CommonErrors& errors) {
  const double certainty = 1 / (errors.noise_scale * errors.noise_scale);
  std::array<Products<Unknowns>, measurement_groups> products;
  for (const Measurement& m : measurements) products[m.group].add(m, robust_certainty(m, lines, certainty));
  Sums sums{Equations(Unknowns), {}, {}, {}};
  for (std::size_t group = 0; group < measurement_groups; ++group) {
    if (group == errors_of_boundary.size()) sums.of_boundaries = sums.equations.xx;
    sums.pulls[group] = gathered(products[group], group, sums.equations);
    sums.pulls[group].error_px = errors.noise_scale * errors.px[group];
    sums.pulls[group].told_px = errors.noise_scale * errors.told_px[group];
  }
  sums.equations.add(UnknownVector::Unit(Unknowns, Unknowns - 1), PrintVector::Zero(), certainty, film_prior);
  if (errors.whole_px > 0 || errors.leaning_px > 0) add_pulls_of_all(measurements, lines, certainty, errors, sums);
  return sums;
}

// What the residuals say about the print's errors, whatever the pose, the film and the common errors are.
std::optional<PrintInformation> information_of(const Sums& sums) {
  Equations e = sums.equations;
  for (const Pull& pull : sums.pulls)
    if (pull.weight > 0) e.add(pull.x, pull.n, -1 / (pull.weight + 1 / (pull.error_px * pull.error_px)), pull.residual);
  const auto inverse = inverse_of(e.xx);
  if (!inverse) return std::nullopt;
  const CrossMatrix through = e.nx.lazyProduct(*inverse);
  return PrintInformation{e.nn - through.lazyProduct(e.nx.transpose()), e.n - through.lazyProduct(e.x)};
}

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

PrintShapes doubted_shapes_mm(const PrintDoubt& doubt, const Sums& sums, const Marker& marker) {
  std::array<double, 4> weights{};
  for (std::size_t k = 0; k < weights.size(); ++k) weights[k] = sums.pulls[k].weight;
  return shapes_of(doubt, sums.equations.nn, weights, marker);
}

struct Solution {
  UnknownVector step;
  PrintVector print_mm = PrintVector::Zero();
  UnknownMatrix covariance;
};

// A solution's covariance by the common errors that are told, and without any.
struct Told {
  UnknownMatrix covariance, without_common;
};

// The likeliest pose when the print's errors are so, and how sure it is; `told`: by the common errors that are told.
std::optional<Solution> solved(const Sums& sums, const PrintPrior& prior, Told* told = nullptr) {
  const Equations& e = sums.equations;
  const PrintMatrix print_covariance = covariance_of(e.nn, prior);
  const CrossMatrix by_x = print_covariance.lazyProduct(e.nx);
  const auto inverted = inverse_of(e.xx - e.nx.transpose().lazyProduct(by_x));
  if (!inverted) return std::nullopt;
  const UnknownMatrix& inverse = *inverted;
  Solution solution;
  solution.step = inverse * (e.x - by_x.transpose() * e.n);
  solution.print_mm = print_covariance * (e.n - e.nx * solution.step);
  solution.covariance = inverse;
  const auto widen = [&](const Pull& pull) {
    const UnknownVector shift = inverse * (pull.x - by_x.transpose() * pull.n);
    const UnknownVector error = pull.error_px * shift;
    solution.covariance.noalias() += error * error.transpose();
    if (!told) return;
    const UnknownVector told_error = pull.told_px * shift;
    told->covariance.noalias() += told_error * told_error.transpose();
  };
  if (told) told->covariance = told->without_common = inverse;
  for (const Pull& pull : sums.pulls) widen(pull);
  for (const Pull& pull : sums.of_all_boundaries) widen(pull);
  const bool finite = solution.covariance.allFinite() && solution.step.allFinite() && solution.print_mm.allFinite();
  return finite && (solution.covariance.diagonal().array() > 0).all() ? std::optional(solution) : std::nullopt;
}

// What is less uncertain of an exact print's pose where noise is smaller by this scale; the film's prior leaves what it
// does.
UnknownMatrix covariance_of_less_noise(const UnknownMatrix& all, double noise_scale) {
  const UnknownVector by_film = all.col(all.cols() - 1);
  return (1 - noise_scale * noise_scale) * (all - by_film * by_film.transpose());
}

// The same of the whole pose, by half of what boundaries' noise is smaller: their scatter says less of angles, which
// neighbours tell, than of places.
UnknownMatrix covariance_of_less_boundary_noise(const Sums& sums, const UnknownMatrix& all, double noise_scale) {
  const UnknownMatrix by_boundaries = all.lazyProduct(sums.of_boundaries);
  UnknownMatrix less = by_boundaries.lazyProduct(all);
  less *= (1 - noise_scale * noise_scale) / 2;
  return less;
}

// Weighted solutions as one.
class Mixture {
 public:
  explicit Mixture(int unknowns)
      : step_(UnknownVector::Zero(unknowns)), squares_(UnknownMatrix::Zero(unknowns, unknowns)) {}
  void add(const Solution& solution, double weight) {
    step_ += weight * solution.step;
    print_mm_ += weight * solution.print_mm;
    squares_ += weight * (solution.covariance + solution.step * solution.step.transpose());
    weight_ += weight;
  }
  Solution mean() const {
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

// The variance of psi among weighted solutions.
class PsiSpread {
 public:
  explicit PsiSpread(Eigen::Index psi) : psi_(psi) {}
  void add(const Solution& solution, double weight) {
    add(solution.step[psi_], solution.covariance(psi_, psi_), weight);
  }
  void add(double psi_rad, double variance, double weight) {
    weight_ += weight, sum_ += weight * psi_rad;
    squares_ += weight * (variance + psi_rad * psi_rad);
  }
  double weight() const { return weight_; }
  double variance() const { return about(sum_ / weight_); }
  // Mean square of what lies beside that.
  double about(double psi_rad) const {
    return squares_ / weight_ - psi_rad * (2 * sum_ / weight_ - psi_rad);
  }

 private:
  Eigen::Index psi_;
  double weight_ = 0, sum_ = 0, squares_ = 0;
};

constexpr std::size_t sizes = print_sigmas_mm.size();
using Weights = std::array<double, sizes + 1>;  // of the tolerated print, and of those that are off by print_sigmas_mm

// Of a print that is off by this size and the tolerance.
PrintPrior prior_of(std::size_t size, double tolerance_mm) {
  return {std::hypot(print_sigmas_mm[size], tolerance_mm), print_sigmas_mm[size] >= print_limits.least_ink_aside_mm};
}

// The likelihoods' logarithms, the largest 0.
Weights gains_of(const PrintInformation& print, double tolerance_mm) {
  const PrintEvidence evidence(print);
  Weights gains{evidence.gain({tolerance_mm})};
  for (std::size_t i = 0; i < sizes; ++i) gains[i + 1] = evidence.gain(prior_of(i, tolerance_mm));
  const double best = *std::max_element(gains.begin(), gains.end());
  for (double& gain : gains) gain -= best;
  return gains;
}

// `fractions`: how often prints are off by print_sigmas_mm.
Weights weights_of(const Weights& gains, const std::array<double, sizes>& fractions) {
  Weights weights{(1 - std::accumulate(fractions.begin(), fractions.end(), 0.0)) * std::exp(gains[0])};
  for (std::size_t i = 0; i < sizes; ++i) weights[i + 1] = fractions[i] * std::exp(gains[i + 1]);
  return weights;
}

double off_probability(const Weights& weights) {
  return 1 - weights[0] / std::accumulate(weights.begin(), weights.end(), 0.0);
}

// Of prints that are the rig's but for an ink that lies aside. `psi_by_mm`: what such an ink turns psi by; `psi_variance`
// is an exact print's, whose psi is 0.
void add_inks(const PrintInformation& print, double exact_gain, double psi_by_mm, double psi_variance,
              PsiSpread& suspected) {
  constexpr double certain = 50;
  for (const double sigma_mm : print_limits.ink_sigmas_mm) {
    const InkAside ink = ink_aside(print, sigma_mm);
    suspected.add(psi_by_mm * ink.shift_mm, psi_variance + psi_by_mm * psi_by_mm * ink.variance_mm2,
                  print_limits.suspected_ink_fraction * std::exp(std::min(exact_gain + ink.gain, certain)));
  }
}

bool suspects_the_print(const PrintDoubt& doubt) {
  return doubt.boundary_px > print_limits.least_doubt_px || doubt.length_fraction > print_limits.least_doubted_length;
}

bool has_measured_bands(const Marker& marker) {
  return marker.sigmas.bands_upper_m && marker.sigmas.bands_lower_m;
}

}  // namespace

double ResidualLine::residual_px(const Measurement& m) const {
  const double unit = m.along_px_per_m != 0 ? m.along_px_per_m : 1;
  return m.residual_px - unit * (at_start + slope * m.turn_fraction);
}

ResidualLines residual_lines(std::span<const Measurement> measurements) {
  ResidualLines lines;
  for (std::size_t group = 0; group < measurement_groups; ++group) lines[group] = line_of(measurements, group);
  return lines;
}

double scatter_sigmas(std::span<const Measurement> measurements, const ResidualLines& lines) {
  double squares = 0;
  int inliers = 0;
  for (const Measurement& m : measurements) {
    const double sigmas = std::abs(lines[m.group].residual_px(m)) / m.sigma_px;
    if (m.group < 4 && sigmas <= inlier_sigmas) squares += sigmas * sigmas, ++inliers;
  }
  return inliers ? std::sqrt(squares / inliers) : 0;
}

double alike_sigmas(std::span<const Measurement> measurements, const ResidualLines& lines) {
  constexpr int run = 6;
  double squares = 0, run_squares = 0, sum = 0;
  int inliers = 0, runs = 0, in_run = 0;
  std::size_t group = measurement_groups;
  for (const Measurement& m : measurements) {
    const double sigmas = lines[m.group].residual_px(m) / m.sigma_px;
    if (m.group >= 4 || std::abs(sigmas) > inlier_sigmas) continue;
    if (m.group != group) group = m.group, in_run = 0, sum = 0;
    squares += sigmas * sigmas, ++inliers;
    sum += sigmas;
    if (++in_run < run) continue;
    run_squares += sum * sum / run, ++runs;
    in_run = 0, sum = 0;
  }
  if (runs == 0) return 0;
  return std::sqrt(std::max(0.0, (run_squares / runs - squares / inliers) / (run - 1)));
}

std::optional<PrintFit> fit_print(std::span<Measurement> measurements, const ResidualLines& lines, int pose_unknowns,
                                  double film_prior, const Marker& marker, const CommonErrors& errors) {
  const Sums sums = pose_unknowns == 4 ? sums_of<5>(measurements, lines, film_prior, errors)
                                       : sums_of<7>(measurements, lines, film_prior, errors);
  const double tolerance_mm = marker.tolerance_m / mm;
  Told of_exact, of_tolerated;
  const auto exact = solved(sums, {}, &of_exact);
  auto tolerated = tolerance_mm > 0 ? solved(sums, {tolerance_mm}, &of_tolerated) : exact;
  if (!exact || !tolerated) return std::nullopt;
  // The exact print's pose is where the measurements were taken.
  if (tolerance_mm == 0) tolerated->step.setZero(), tolerated->print_mm.setZero();
  const Told& by_told = tolerance_mm > 0 ? of_tolerated : of_exact;
  Solution told_tolerated = *tolerated;
  told_tolerated.covariance =
      by_told.covariance - covariance_of_less_noise(of_exact.without_common, errors.told_noise_scale);
  // Nothing, where the frame tells nothing of the print.
  const PrintInformation print = information_of(sums).value_or(PrintInformation{});
  const PrintInformation left = doubted(print, doubted_shapes_mm(errors.doubt, sums, marker));
  const Weights gains = gains_of(left, tolerance_mm);
  const Weights judged_by = weights_of(gains, print_limits.fractions);
  const Weights told_by = weights_of(gains, print_limits.told_fractions);
  const bool suspects = suspects_the_print(errors.doubt);
  const Weights suspected_by = weights_of(gains, suspects ? print_limits.suspected_fractions : print_limits.fractions);
  const int psi = pose_unknowns - 1;
  Mixture judged(pose_unknowns + 1), told(pose_unknowns + 1);
  PsiSpread suspected(psi);
  const auto add = [&](const Solution& solution, const Solution& as_told, std::size_t at) {
    judged.add(solution, judged_by[at]), told.add(as_told, told_by[at]);
    if (suspects) suspected.add(solution, suspected_by[at]);
  };
  add(*tolerated, told_tolerated, 0);
  for (std::size_t i = 0; i < sizes; ++i) {
    if (std::max(judged_by[i + 1], told_by[i + 1]) < print_limits.min_weight &&
        suspected_by[i + 1] < print_limits.min_suspected_weight)
      continue;
    const auto off = solved(sums, prior_of(i, tolerance_mm));
    if (!off) return std::nullopt;
    add(*off, *off, i + 1);
  }
  const Solution mean = judged.mean();
  for (Measurement& m : measurements) m.residual_px -= m.row.dot(mean.step) + print_shift_px(m, mean.print_mm);
  PrintFit fit;
  fit.step = mean.step;
  const UnknownMatrix less = tolerated->covariance - by_told.covariance +
                             covariance_of_less_boundary_noise(sums, of_exact.without_common, errors.told_noise_scale);
  fit.covariance =
      (mean.covariance - (1 - off_probability(judged_by)) * less).topLeftCorner(pose_unknowns, pose_unknowns);
  double told_variance = told.about(mean.step)(psi, psi);
  const double exact_variance = tolerated->covariance(psi, psi);
  if (suspects) {
    const double psi_by_ink = -by_ink_aside(sums.equations.nx * of_exact.without_common.col(psi));
    add_inks(left, gains[0], psi_by_ink, exact_variance, suspected);
    fit.suspected_probability = 1 - suspected_by[0] / suspected.weight();
    fit.psi_variance_suspected = suspected.variance() - exact_variance;
    const double less_of_exact = exact_variance - told_tolerated.covariance(psi, psi);
    if (!has_measured_bands(marker))
      told_variance = std::max(told_variance,
                               suspected.about(mean.step[psi]) - (1 - fit.suspected_probability) * less_of_exact);
  }
  const double widened = std::sqrt(told_variance / fit.covariance(psi, psi));
  fit.covariance.row(psi) *= widened, fit.covariance.col(psi) *= widened;
  fit.inner_off_m = inner_off_mm(print, errors.inner_doubt_scale) * mm;
  fit.off_probability = off_probability(judged_by);
  fit.psi_variance = mean.covariance(psi, psi);
  fit.psi_variance_by_print = mean.covariance(psi, psi) - exact_variance;
  fit.psi_variance_by_tolerance = exact_variance - exact->covariance(psi, psi);
  return fit;
}

}  // namespace lapservo::internal
