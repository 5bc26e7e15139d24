#include "lapservo/vision/print_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/vision/normal_equations.h"

namespace lapservo {
namespace {

constexpr double cauchy_scale_sigmas = 2.5, inlier_sigmas = 5;
constexpr double most_degrees = 15;  // of the evidence that is carried on: some frames
constexpr double mm = 1e-3;          // the print's errors are in millimetres here

// The bands' errors first: e0, e1 at both edges, e2 at both edges, e3; then those of film and shaft: the slopes of both
// ends, which are circles unless wrapped askew, and the radius.
constexpr int print_errors = 9, band_errors = 6, other_errors = 3;
constexpr int slope_of_e0 = 6, slope_of_e3 = 7, radius_error = 8;
using PrintVector = Eigen::Matrix<double, print_errors, 1>;
using PrintMatrix = Eigen::Matrix<double, print_errors, print_errors>;
using CrossMatrix = Eigen::Matrix<double, print_errors, Eigen::Dynamic, 0, print_errors, max_unknowns>;

// A group's residuals as a straight line over the print, of boundaries as metres along the shaft, of sides a constant
// in pixels.
struct Line {
  double at_start = 0, slope = 0;

  double residual_px(const Measurement& m) const {
    const double unit = m.along_px_per_m != 0 ? m.along_px_per_m : 1;
    return m.residual_px - unit * (at_start + slope * m.turn_share);
  }
};
using Lines = std::array<Line, measurement_groups>;

// Robust: from the median on, reweighted. A boundary that lies elsewhere as a whole is no outlier to itself; one with
// few points is judged with the others, about zero.
Line line_of(std::span<const Measurement> measurements, std::size_t group) {
  constexpr int iterations = 4;
  constexpr std::size_t fewest = 8;
  constexpr double usual_slope = 1 * mm;  // a turn
  InplaceVector<double, EdgeMeasurements::most_lines> values;
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
      const Eigen::Vector2d row(1, group < 4 ? m.turn_share : 0);
      information += weight * row * row.transpose();
      gradient += weight * m.residual_px / unit * row;
    }
    const Eigen::Vector2d solved = information.ldlt().solve(gradient);
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

// d(residual)/d(print's errors) [px/mm]: of a boundary two, and the radius'.
PrintVector print_row(const Measurement& m) {
  PrintVector row = PrintVector::Zero();
  const double along = mm * m.along_px_per_m, share = m.turn_share;
  if (m.group == 0) row[0] = along, row[slope_of_e0] = along * (share - 0.5);
  if (m.group == 1) row[1] = along * (1 - share), row[2] = along * share;
  if (m.group == 2) row[3] = along * (1 - share), row[4] = along * share;
  if (m.group == 3) row[5] = along, row[slope_of_e3] = along * (share - 0.5);
  row[radius_error] = mm * m.out_px_per_m;
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

// What the first `Count` of the print's errors say, when the other ones are normal with this standard deviation.
template <int Count, int Others>
PrintEvidence likeliest(const PrintMatrix& all, const PrintVector& pull, double others_mm) {
  using Vector = Eigen::Matrix<double, Count, 1>;
  using Matrix = Eigen::Matrix<double, Count, Count>;
  const Eigen::Matrix<double, Others, Others> rest =
      all.template bottomRightCorner<Others, Others>() +
      Eigen::Matrix<double, Others, Others>::Identity() / (others_mm * others_mm);
  const Eigen::Matrix<double, Count, Others> through =
      rest.llt().solve(all.template bottomLeftCorner<Others, Count>()).transpose();
  const Matrix information =
      all.template topLeftCorner<Count, Count>() - through * all.template bottomLeftCorner<Others, Count>();
  const Vector gradient = pull.template head<Count>() - through * pull.template tail<Others>();
  constexpr double least_gain = 1;  // of the logarithm of the likelihood
  constexpr double smallest_mm = 1e-3, ratio = 1.15;
  constexpr int steps = 58;  // up to 3 mm
  const Eigen::SelfAdjointEigenSolver<Matrix> directions(information);
  const Vector lambda = directions.eigenvalues().cwiseMax(0);
  const Vector squares = (directions.eigenvectors().transpose() * gradient).cwiseAbs2();
  double best = least_gain, best_mm = 0, sigma_mm = smallest_mm;
  for (int i = 0; i < steps; ++i, sigma_mm *= ratio) {
    const double variance = sigma_mm * sigma_mm;
    const Vector spread = 1 + variance * lambda.array();
    const double gain = 0.5 * (variance * squares.cwiseQuotient(spread).sum() - std::log(spread.prod()));
    if (gain > best) best = gain, best_mm = sigma_mm;
  }
  // How many of the errors a frame tells, were they of a usual size.
  constexpr double usual_variance_mm2 = 0.03 * 0.03;
  const Vector told = usual_variance_mm2 * lambda;
  const double degrees = told.cwiseQuotient(Vector(1 + told.array())).sum();
  return {mm * best_mm * std::sqrt(1 - least_gain / best), degrees};
}

struct Evidence {
  PrintEvidence bands;
  double others_m;
};

// The standard deviations of the print's errors that make the residuals likeliest, whatever the pose, the film and the
// common errors are; 0 when the rig's print explains them about as well.
Evidence evidence_of(const Sums& sums) {
  Equations e = sums.equations;
  for (const Pull& pull : sums.pulls)
    if (pull.weight > 0) e.add(pull.x, pull.n, -1 / (pull.weight + 1 / (pull.error_px * pull.error_px)), pull.residual);
  const auto solver = e.xx.ldlt();
  const CrossMatrix through = solver.solve(e.nx.transpose()).transpose();
  const PrintMatrix information = e.nn - through * e.nx.transpose();
  const PrintVector gradient = e.n - through * e.x;
  // Ends that are circles and a shaft of the right size say nothing about the bands: each kind is judged by itself.
  constexpr double loose_mm = 0.3, tight_mm = 1e-4;
  const PrintEvidence others =
      likeliest<other_errors, band_errors>(information.reverse(), gradient.reverse(), loose_mm);
  const PrintEvidence bands =
      likeliest<band_errors, other_errors>(information, gradient, std::max(others.sigma_m / mm, tight_mm));
  return {bands, others.sigma_m};
}

// Both of one print, seen twice.
PrintEvidence pooled(const PrintEvidence& a, const PrintEvidence& b) {
  const double degrees = a.degrees + b.degrees;
  if (!(degrees > 0)) return {};
  return {std::sqrt((a.degrees * a.sigma_m * a.sigma_m + b.degrees * b.sigma_m * b.sigma_m) / degrees),
          std::min(degrees, most_degrees)};
}

// As wide as a t distribution is.
double widened_sigma_m(const PrintEvidence& evidence) {
  constexpr double fewest_degrees = 2.5;
  const double degrees = std::max(evidence.degrees, fewest_degrees);
  return evidence.sigma_m * std::sqrt(degrees / (degrees - 2));
}

struct Solution {
  UnknownVector step;
  PrintVector print_mm = PrintVector::Zero();
  UnknownMatrix covariance;
};

// The likeliest pose when the bands' and the other errors have these standard deviations, and how sure it is.
std::optional<Solution> solved(const Sums& sums, double bands_m, double others_m) {
  const Equations& e = sums.equations;
  const auto certainty = [](double sigma_m) { return 1 / std::max(sigma_m * sigma_m / (mm * mm), 1e-18); };
  PrintVector prior = PrintVector::Constant(certainty(bands_m));
  prior.tail<other_errors>().setConstant(certainty(others_m));
  PrintMatrix of_print = e.nn;
  of_print.diagonal() += prior;
  const Eigen::LLT<PrintMatrix> print(of_print);
  const CrossMatrix by_x = print.solve(e.nx);
  const Eigen::FullPivLU<UnknownMatrix> lu(e.xx - e.nx.transpose() * by_x);
  if (!lu.isInvertible()) return std::nullopt;
  Solution solution;
  const UnknownMatrix inverse = lu.inverse();
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

}  // namespace

double scatter_sigmas(std::span<const Measurement> measurements) {
  return scatter_sigmas(measurements, lines_of(measurements));
}

std::optional<PrintFit> fit_print(std::span<Measurement> measurements, int pose_unknowns, double film_prior,
                                  double tolerance_m, const CommonErrors& errors, const PrintEvidence& before) {
  const Sums sums = sums_of(measurements, lines_of(measurements), pose_unknowns, film_prior, errors);
  const Evidence evidence = evidence_of(sums);
  PrintFit fit;
  fit.evidence = pooled(before, evidence.bands);
  fit.sigma_m = std::max(widened_sigma_m(fit.evidence), tolerance_m);
  const double others_m = std::max(evidence.others_m, tolerance_m);
  const auto exact = solved(sums, 0, evidence.others_m), tolerated = solved(sums, tolerance_m, others_m),
             best = fit.sigma_m > tolerance_m ? solved(sums, fit.sigma_m, others_m) : tolerated;
  if (!exact || !tolerated || !best) return std::nullopt;
  // The exact print's pose is where the measurements were taken.
  fit.step = fit.sigma_m > 0 || others_m > 0 ? best->step : UnknownVector::Zero(pose_unknowns + 1);
  for (Measurement& m : measurements) m.residual_px -= m.row.dot(fit.step) + print_row(m).dot(best->print_mm);
  const int psi = pose_unknowns - 1;
  fit.covariance = best->covariance.topLeftCorner(pose_unknowns, pose_unknowns);
  fit.psi_variance_by_print = fit.covariance(psi, psi) - tolerated->covariance(psi, psi);
  fit.psi_variance_by_tolerance = tolerated->covariance(psi, psi) - exact->covariance(psi, psi);
  return fit;
}

}  // namespace lapservo
