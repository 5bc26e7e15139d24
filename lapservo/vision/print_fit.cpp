#include "lapservo/vision/print_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/vision/limits.h"
#include "lapservo/vision/normal_equations.h"

namespace lapservo::internal {
namespace {

constexpr auto& print_sigmas_mm = print_limits.sigmas_mm;
constexpr double mm = 1e-3;  // the print's errors are in millimetres here

// e0, e1 at both edges, e2 at both edges, e3: the ends are circles.
constexpr int print_errors = 6;
using PrintVector = Eigen::Matrix<double, print_errors, 1>;
using PrintMatrix = Eigen::Matrix<double, print_errors, print_errors>;
using CrossMatrix = Eigen::Matrix<double, print_errors, Eigen::Dynamic, 0, print_errors, max_unknowns>;

// A group's residuals as a straight line over the print, of boundaries as metres along the shaft, of sides a constant
// in pixels.
struct Line {
  double at_start = 0, slope = 0;

  double residual_px(const Measurement& m) const {
    const double unit = m.along_px_per_m != 0 ? m.along_px_per_m : 1;
    return m.residual_px - unit * (at_start + slope * m.turn_fraction);
  }
};
using Lines = std::array<Line, measurement_groups>;

// Robust: from the median on, reweighted. A boundary that lies elsewhere as a whole is no outlier to itself; one with
// few points is compared with the others, about zero.
Line line_of(std::span<const Measurement> measurements, std::size_t group) {
  constexpr int iterations = 4;
  constexpr std::size_t fewest = 8;
  constexpr double usual_slope = 1 * mm;  // a turn
  InplaceVector<double, EdgeMeasurements::max_lines> values;
  for (const Measurement& m : measurements)
    if (m.group == group) values.push_back(m.residual_px / (group < 4 ? m.along_px_per_m : 1));
  if (values.size() < fewest) return {};
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  Line line{*middle, 0};
  for (int i = 0; i < iterations; ++i) {
    Eigen::Matrix2d information = Eigen::Vector2d(0, 1 / (usual_slope * usual_slope)).asDiagonal();
    Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
    for (const Measurement& m : measurements) {
      if (m.group != group) continue;
      const double unit = group < 4 ? m.along_px_per_m : 1;
      const double weight = cauchy_weight(line.residual_px(m) / m.sigma_px, cauchy_scale_sigmas) * unit * unit /
                            (m.sigma_px * m.sigma_px);
      const Eigen::Vector2d row(1, group < 4 ? m.turn_fraction : 0);
      information += weight * row * row.transpose();
      gradient += weight * m.residual_px / unit * row;
    }
    const Eigen::Vector2d solved = information.inverse() * gradient;
    line = {solved[0], solved[1]};
  }
  return line;
}

Lines lines_of(std::span<const Measurement> measurements) {
  Lines lines;
  for (std::size_t group = 0; group < measurement_groups; ++group) lines[group] = line_of(measurements, group);
  return lines;
}

double scatter_sigmas(std::span<const Measurement> measurements, const Lines& lines) {
  double squares = 0;
  int inliers = 0;
  for (const Measurement& m : measurements) {
    const double sigmas = std::abs(lines[m.group].residual_px(m)) / m.sigma_px;
    if (m.group < 4 && sigmas <= inlier_sigmas) squares += sigmas * sigmas, ++inliers;
  }
  return inliers ? std::sqrt(squares / inliers) : 0;
}

// d(residual)/d(print's errors) [px/mm]: of an inner boundary two.
PrintVector print_row(const Measurement& m) {
  PrintVector row = PrintVector::Zero();
  const double along = mm * m.along_px_per_m, fraction = m.turn_fraction;
  if (m.group == 0) row[0] = along;
  if (m.group == 1) row[1] = along * (1 - fraction), row[2] = along * fraction;
  if (m.group == 2) row[3] = along * (1 - fraction), row[4] = along * fraction;
  if (m.group == 3) row[5] = along;
  return row;
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
  double weight = 0, residual = 0, error_px = 0;
};

struct Sums {
  Equations equations;
  std::array<Pull, measurement_groups> pulls;
};

Sums sums_of(std::span<const Measurement> measurements, const Lines& lines, int pose_unknowns, double film_prior,
             const CommonErrors& errors) {
  const int unknowns = pose_unknowns + 1;
  const double certainty = 1 / (errors.noise_scale * errors.noise_scale);
  Sums sums{Equations(unknowns), {}};
  for (std::size_t group = 0; group < measurement_groups; ++group) {
    sums.pulls[group].x = UnknownVector::Zero(unknowns);
    sums.pulls[group].error_px = errors.noise_scale * (group < 4 ? errors.boundary_px : errors.side_px);
  }
  sums.equations.add(UnknownVector::Unit(unknowns, pose_unknowns), PrintVector::Zero(), certainty, film_prior);
  for (const Measurement& m : measurements) {
    const double sigmas = lines[m.group].residual_px(m) / m.sigma_px;
    const double weight = certainty * cauchy_weight(sigmas, cauchy_scale_sigmas) / (m.sigma_px * m.sigma_px);
    const PrintVector row = print_row(m);
    sums.equations.add(m.row, row, weight, m.residual_px);
    Pull& pull = sums.pulls[m.group];
    pull.x += weight * m.row;
    pull.n += weight * row;
    pull.weight += weight;
    pull.residual += weight * m.residual_px;
  }
  return sums;
}

// What the residuals say about the print's errors, whatever the pose, the film and the common errors are.
class Evidence {
 public:
  Evidence(const Sums& sums, double doubt_scale) {
    const double certainty = 1 / (doubt_scale * doubt_scale);
    Equations e = sums.equations;
    for (const Pull& pull : sums.pulls)
      if (pull.weight > 0)
        e.add(pull.x, pull.n, -1 / (pull.weight + 1 / (pull.error_px * pull.error_px)), pull.residual);
    const auto inverse = inverse_of(e.xx);
    if (!inverse) return;  // the frame tells nothing of the print
    const CrossMatrix through = e.nx * *inverse;
    const PrintVector gradient = e.n - through * e.x;
    const Eigen::SelfAdjointEigenSolver<PrintMatrix> directions(e.nn - through * e.nx.transpose());
    information_ = certainty * directions.eigenvalues().cwiseMax(0);
    squares_ = certainty * certainty * (directions.eigenvectors().transpose() * gradient).cwiseAbs2();
  }
  // Logarithm of the likelihood of this standard deviation, compared with none.
  double gain(double sigma_mm) const {
    const double variance = sigma_mm * sigma_mm;
    const PrintVector spread = 1 + variance * information_.array();
    return 0.5 * (variance * squares_.cwiseQuotient(spread).sum() - std::log(spread.prod()));
  }

 private:
  PrintVector information_ = PrintVector::Zero(),
              squares_ = PrintVector::Zero();  // along the directions that are independent
};

struct Solution {
  UnknownVector step;
  PrintVector print_mm = PrintVector::Zero();
  UnknownMatrix covariance;
};

// The likeliest pose when each of the print's errors has this standard deviation, and how sure it is.
std::optional<Solution> solved(const Sums& sums, double sigma_mm) {
  const Equations& e = sums.equations;
  const PrintMatrix of_print = e.nn + PrintMatrix::Identity() / std::max(sigma_mm * sigma_mm, 1e-18);
  const Eigen::LLT<PrintMatrix> print(of_print);
  const CrossMatrix by_x = print.solve(e.nx);
  const auto inverted = inverse_of(e.xx - e.nx.transpose() * by_x);
  if (!inverted) return std::nullopt;
  const UnknownMatrix& inverse = *inverted;
  Solution solution;
  solution.step = inverse * (e.x - by_x.transpose() * e.n);
  solution.print_mm = print.solve(e.n - e.nx * solution.step);
  solution.covariance = inverse;
  for (const Pull& pull : sums.pulls) {
    const UnknownVector shift = inverse * (pull.x - by_x.transpose() * pull.n);
    solution.covariance += pull.error_px * pull.error_px * shift * shift.transpose();
  }
  const bool finite = solution.covariance.allFinite() && solution.step.allFinite() && solution.print_mm.allFinite();
  return finite && (solution.covariance.diagonal().array() > 0).all() ? std::optional(solution) : std::nullopt;
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
    return {step, print_mm_ / weight_, squares_ / weight_ - step * step.transpose()};
  }

 private:
  UnknownVector step_;
  PrintVector print_mm_ = PrintVector::Zero();
  UnknownMatrix squares_;
  double weight_ = 0;
};

// How likely the tolerated print and those that are off by print_sigmas_mm are, the likeliest of them 1 at most.
std::array<double, print_sigmas_mm.size() + 1> weights_of(const Evidence& evidence, double tolerance_mm) {
  std::array<double, print_sigmas_mm.size() + 1> gains{evidence.gain(tolerance_mm)};
  for (std::size_t i = 0; i < print_sigmas_mm.size(); ++i)
    gains[i + 1] = evidence.gain(std::hypot(print_sigmas_mm[i], tolerance_mm));
  const double best = *std::max_element(gains.begin(), gains.end());
  std::array<double, print_sigmas_mm.size() + 1> weights{};
  weights[0] = (1 - print_limits.off_fraction) * std::exp(gains[0] - best);
  double fraction = print_limits.off_fraction / 2;
  for (std::size_t i = 1; i < gains.size(); ++i, fraction /= 2) weights[i] = fraction * std::exp(gains[i] - best);
  return weights;
}

}  // namespace

double scatter_sigmas(std::span<const Measurement> measurements) {
  return scatter_sigmas(measurements, lines_of(measurements));
}

std::optional<PrintFit> fit_print(std::span<Measurement> measurements, int pose_unknowns, double film_prior,
                                  double tolerance_m, const CommonErrors& errors) {
  const Sums sums = sums_of(measurements, lines_of(measurements), pose_unknowns, film_prior, errors);
  const double tolerance_mm = tolerance_m / mm;
  const auto exact = solved(sums, 0);
  auto tolerated = tolerance_m > 0 ? solved(sums, tolerance_mm) : exact;
  if (!exact || !tolerated) return std::nullopt;
  // The exact print's pose is where the measurements were taken.
  if (tolerance_m == 0) tolerated->step.setZero(), tolerated->print_mm.setZero();
  const auto weights = weights_of(Evidence(sums, errors.doubt_scale), tolerance_mm);
  Mixture mixture(pose_unknowns + 1);
  mixture.add(*tolerated, weights[0]);
  for (std::size_t i = 0; i < print_sigmas_mm.size(); ++i) {
    if (weights[i + 1] < print_limits.min_weight) continue;
    const auto off = solved(sums, std::hypot(print_sigmas_mm[i], tolerance_mm));
    if (!off) return std::nullopt;
    mixture.add(*off, weights[i + 1]);
  }
  const Solution mean = mixture.mean();
  for (Measurement& m : measurements) m.residual_px -= m.row.dot(mean.step) + print_row(m).dot(mean.print_mm);
  const int psi = pose_unknowns - 1;
  PrintFit fit;
  fit.step = mean.step;
  fit.covariance = mean.covariance.topLeftCorner(pose_unknowns, pose_unknowns);
  fit.off_probability = 1 - weights[0] / std::accumulate(weights.begin(), weights.end(), 0.0);
  fit.psi_variance_by_print = fit.covariance(psi, psi) - tolerated->covariance(psi, psi);
  fit.psi_variance_by_tolerance = tolerated->covariance(psi, psi) - exact->covariance(psi, psi);
  return fit;
}

}  // namespace lapservo::internal
