#include "lapservo/calibration/marker/print_adjustment.h"

#include <algorithm>
#include <ceres/ceres.h>
#include <cmath>
#include <cstddef>
#include <utility>

#include "lapservo/calibration/fit/ceres_fit.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/rounded_sigma.h"
#include "lapservo/core/statistics.h"
#include "lapservo/marker/sensitivity.h"
#include "lapservo/vision/model/common_errors.h"

namespace lapservo::internal {
namespace {

constexpr double mm = 1e-3;
// Beyond the scatter of frames; those that see the marker from nearly one side err alike.
constexpr double unmodelled_sigmas = 1.3;
constexpr std::size_t alike_frames = 6;  // frames lie in the order of the sides that face the camera
constexpr int pose_numbers = 6;
constexpr std::size_t upper_group = measurement_groups, groups = measurement_groups + 2;

// Before the fit, one sigma: the manufacturing error of a print; and model errors common to all frames, which are fixed
// at zero: estimating them from so many frames would trust the model to a thousandth of a pixel.
constexpr double print_prior_mm = 2, gap_prior_rad = 0.5;
constexpr double zero = 1e-3;            // of the sigmas of these
constexpr double common_seam_px = 0.03;  // of one frame
// Compressed video leaves the seam's edges 0.05 to 0.14 px behind and the bands' boundaries, which move less, at most
// 0.02 px. A rotation there and back shows by how much; in one direction a lag looks like a displaced seam.
constexpr double seam_lag_px = 0.1, seam_lag_from_px = 0.2;
constexpr std::ptrdiff_t min_seam_views_each_way = 3;
constexpr double min_noise_of_lag = 0.3;  // of edges, beyond the usual

struct TakenForZero {
  double* unknown;
  double sigma;
};

// The unknowns of all frames alike.
struct SharedUnknowns {
  std::array<double, 4> upper_mm{}, lower_mm{};  // changes of the boundaries; upper_mm[0] stays 0
  double gap_rad = 0;
  double film_sigmas = 0;                 // what all films are off by, in film_sigma_m
  double sides_px = 0;                    // what all sides are off by, and so on
  std::array<double, 2> seam_edges_px{};  // upper and lower
  std::array<double, 4> boundaries_px{};
  double seam_lag_px = 0;  // by how much the seam's edges stay behind their motion

  // As PrintNumbers, lengths in mm.
  std::array<double*, print_numbers> print() {
    return {&upper_mm[1], &upper_mm[2], &upper_mm[3], &lower_mm[0], &lower_mm[1], &lower_mm[2], &lower_mm[3], &gap_rad};
  }
  // Measured on rendered frames: sides up to 0.08 px, an end whose face is seen up to 0.1 px, inner boundaries 0.01 px.
  std::array<TakenForZero, 8> taken_for_zero() {
    return {{{&film_sigmas, 1},
             {&sides_px, 0.05},
             {&seam_edges_px[0], 0.03},
             {&seam_edges_px[1], 0.03},
             {&boundaries_px[0], 0.05},
             {&boundaries_px[1], 0.01},
             {&boundaries_px[2], 0.01},
             {&boundaries_px[3], 0.05}}};
  }
};

// Unknowns of a frame: its pose, its film as in every fit of the tracker, and the common error of each group of its
// measurements.
struct FrameUnknowns {
  std::array<double, pose_numbers> pose{};
  double film_sigmas = 0;
  std::array<double, groups> common_px{};
};

// A block of unknowns and the slope by each of them.
struct Term {
  using Slopes = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, pose_numbers, 1>;
  Term(double* unknown_block, double slope) : block(unknown_block), slopes(Slopes::Constant(1, slope)) {}
  Term(std::array<double, pose_numbers>& pose, const UnknownVector& row)
      : block(pose.data()), slopes(row.head<pose_numbers>()) {}
  double* block;
  Slopes slopes;
};

// (slopes . unknowns - expected) / sigma.
class LinearCost : public ceres::CostFunction {
 public:
  LinearCost(std::vector<Term> terms, double expected, double sigma)
      : terms_(std::move(terms)), expected_(expected), sigma_(sigma) {
    set_num_residuals(1);
    for (const Term& term : terms_) {
      blocks_.push_back(term.block);
      mutable_parameter_block_sizes()->push_back(static_cast<int>(term.slopes.size()));
    }
  }
  const std::vector<double*>& blocks() const { return blocks_; }
  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    residuals[0] = -expected_ / sigma_;
    for (std::size_t i = 0; i < terms_.size(); ++i) {
      const Term::Slopes& slopes = terms_[i].slopes;
      residuals[0] += slopes.dot(Eigen::Map<const Eigen::VectorXd>(parameters[i], slopes.size())) / sigma_;
      if (jacobians && jacobians[i]) Eigen::Map<Eigen::VectorXd>(jacobians[i], slopes.size()) = slopes / sigma_;
    }
    return true;
  }
  // In sigmas, by the unknowns as they are now.
  double left() const {
    double residual = 0;
    Evaluate(blocks_.data(), &residual, nullptr);
    return -residual;
  }
  double sigma() const { return sigma_; }

 private:
  std::vector<Term> terms_;
  std::vector<double*> blocks_;
  double expected_, sigma_;
};

void add_prior(ceres::Problem& problem, double* unknown, double expected, double sigma) {
  problem.AddResidualBlock(new LinearCost({{unknown, 1}}, expected, sigma), nullptr, unknown);
}

std::vector<Term> terms_of(const Measurement& m, const PrintShape& shape, double covered_rad, FrameUnknowns& frame,
                           SharedUnknowns& shared) {
  const double by_film = m.row[pose_numbers];
  std::vector<Term> terms{{frame.pose, m.row},
                          {&frame.common_px[m.group], 1},
                          {&frame.film_sigmas, by_film},
                          {&shared.film_sigmas, by_film}};
  if (m.group >= 4) {
    terms.push_back({&shared.sides_px, 1});
    return terms;
  }
  const std::size_t k = m.group;
  const double along = mm * m.along_px_per_m;
  terms.push_back({&shared.boundaries_px[k], 1});
  if (k > 0) terms.push_back({&shared.upper_mm[k], along * (1 - m.turn_fraction)});
  terms.push_back({&shared.lower_mm[k], along * m.turn_fraction});
  // A wider gap leaves less around the shaft for the same print.
  terms.push_back(
      {&shared.gap_rad, m.along_px_per_m * (shape.lower_m[k] - shape.upper_m[k]) * m.turn_fraction / covered_rad});
  return terms;
}

double moved_px(const SeamEdge& edge, double turned_rad) {
  return edge.row[psi_unknown] * turned_rad;
}

std::vector<Term> terms_of(const SeamEdge& edge, bool lower, double turned_rad, FrameUnknowns& frame,
                           SharedUnknowns& shared) {
  const double along_px = moved_px(edge, turned_rad);
  return {{frame.pose, edge.row},
          {&frame.common_px[upper_group + (lower ? 1 : 0)], 1},
          {&shared.seam_lag_px, -along_px / std::hypot(along_px, seam_lag_from_px)},
          {&shared.gap_rad, edge.by_gap_px},
          {&shared.seam_edges_px[lower ? 1 : 0], 1}};
}

// The costs are owned by the problem.
struct EdgeCost {
  const LinearCost* cost;
  std::size_t group;
  Eigen::Index row;  // of the problem's residuals
};

double common_sigma_px(std::size_t group, const ViewMeasurements& frame) {
  const double more_px = usual_errors.common_fraction_of_blur * std::max(0.0, frame.blur_px - usual_blur_px);
  if (group >= measurement_groups) return common_seam_px + more_px;
  if (group >= 4) return usual_errors.common_side_px + more_px;
  return std::hypot(common_boundary_px(frame.blur_px, frame.edges.radius_px),
                    usual_errors.fraction_of_processing * frame.bias_px[group]);
}

std::vector<EdgeCost> add_frame(ceres::Problem& problem, const ViewMeasurements& measured, const PrintShape& shape,
                                double covered_rad, double loss_scale_sigmas, SharedUnknowns& shared,
                                FrameUnknowns& frame) {
  std::array<bool, groups> used{};
  const auto add = [&](const auto& edge, std::size_t group, std::vector<Term> terms) {
    auto* cost = new LinearCost(std::move(terms), edge.residual_px, edge.sigma_px);
    problem.AddResidualBlock(cost, new ceres::CauchyLoss(loss_scale_sigmas), cost->blocks());
    used[group] = true;
    return cost;
  };
  add_prior(problem, &frame.film_sigmas, (film_mean_m - measured.film_m) / film_sigma_m, 1);
  std::vector<EdgeCost> edges;
  for (const Measurement& m : measured.edges.all) {
    const Eigen::Index row = problem.NumResiduals();
    edges.push_back({add(m, m.group, terms_of(m, shape, covered_rad, frame, shared)), m.group, row});
  }
  const auto add_seam = [&](const std::optional<SeamEdge>& edge, bool lower) {
    if (edge) add(*edge, upper_group + (lower ? 1 : 0), terms_of(*edge, lower, measured.turned_rad, frame, shared));
  };
  if (measured.seam) add_seam(measured.seam->upper, false), add_seam(measured.seam->lower, true);
  for (std::size_t group = 0; group < groups; ++group)
    if (used[group]) add_prior(problem, &frame.common_px[group], 0, common_sigma_px(group, measured));
  return edges;
}

// Views that hardly moved carry no information on a lag, and their direction of motion depends on their poses' errors.
bool tells_lag(const std::vector<ViewMeasurements>& frames) {
  const auto views = [&](double way) {
    return std::count_if(frames.begin(), frames.end(), [=](const ViewMeasurements& frame) {
      if (!frame.seam || !(way * frame.turned_rad > 0)) return false;
      const auto& edge = frame.seam->upper ? frame.seam->upper : frame.seam->lower;
      return edge && std::abs(moved_px(*edge, frame.turned_rad)) > seam_lag_from_px;
    });
  };
  return std::min(views(1), views(-1)) >= min_seam_views_each_way;
}

void add_priors(ceres::Problem& problem, SharedUnknowns& shared, bool free_lag) {
  for (double* number : shared.print())
    add_prior(problem, number, 0, number == &shared.gap_rad ? gap_prior_rad : print_prior_mm);
  for (const TakenForZero& taken : shared.taken_for_zero()) add_prior(problem, taken.unknown, 0, zero * taken.sigma);
  add_prior(problem, &shared.seam_lag_px, 0, free_lag ? seam_lag_px : zero * seam_lag_px);
}

double sigma_of_edges_px(const std::vector<ViewMeasurements>& frames) {
  std::vector<double> sigmas_px;
  for (const ViewMeasurements& frame : frames)
    for (const Measurement& m : frame.edges.all)
      if (m.group < 4) sigmas_px.push_back(m.sigma_px);
  return sigmas_px.empty() ? usual_errors.usual_sigma_px : median(sigmas_px);
}

// The ratio of the edges' noise to the usual noise: it is higher in compressed images.
double noise_beyond_usual(double sigma_px) {
  return std::max(0.0, sigma_px / usual_errors.usual_sigma_px - 1);
}

// As the tracker has it, in all frames alike.
double common_doubt_scale(const std::vector<ViewMeasurements>& frames, double edges_px) {
  if (frames.empty()) return 1;
  return doubt_scale(edges_px, median(values_of(frames, &ViewMeasurements::blur_px)),
                     median(values_of(frames, [](const ViewMeasurements& frame) {
                       return Eigen::Map<const Eigen::Vector4d>(frame.bias_px.data()).norm() / 2;
                     })));
}

// Effects of the fixed common errors, at one sigma of their prior.
std::vector<TakenForZero> common_errors(SharedUnknowns& shared, const std::vector<ViewMeasurements>& frames,
                                        double edges_px, bool free_lag) {
  const auto taken = shared.taken_for_zero();
  std::vector<TakenForZero> errors(taken.begin(), taken.end());
  const double scale = common_doubt_scale(frames, edges_px);
  for (TakenForZero& error : errors)
    if (error.unknown != &shared.film_sigmas)
      error.sigma *= scale;  // the film's thickness does not depend on the image
  if (!free_lag) errors.push_back({&shared.seam_lag_px, seam_lag_px * std::min(1.0, noise_beyond_usual(edges_px))});
  return errors;
}

constexpr int change_parts = 4;  // of the time, between which a print may change
constexpr std::size_t boundaries = 4;

// Each fault that there may be, of size 0: for either edge, from a part of the time on; for each boundary, curved.
std::vector<PrintFault> possible_faults(double first_s, double last_s) {
  std::vector<PrintFault> faults;
  for (int part = 1; part < change_parts; ++part)
    faults.insert(faults.end(), 2, {PrintFault::Kind::slips, first_s + (last_s - first_s) * part / change_parts});
  faults.insert(faults.end(), boundaries, {PrintFault::Kind::curved});
  return faults;
}

// Slopes of a residual by these, in m.
Eigen::RowVectorXd slopes_of(const Measurement& m, double time_s, const std::vector<PrintFault>& faults) {
  const double along = m.along_px_per_m / m.sigma_px, lower = m.turn_fraction;
  Eigen::RowVectorXd slopes = Eigen::RowVectorXd::Zero(static_cast<Eigen::Index>(faults.size()));
  const std::size_t slips = faults.size() - boundaries;
  for (std::size_t i = 0; i < slips; ++i)
    if (time_s > faults[i].from_s) slopes[static_cast<Eigen::Index>(i)] = (i % 2 == 0 ? 1 - lower : lower) * along;
  slopes[static_cast<Eigen::Index>(slips + m.group)] = 4 * lower * (1 - lower) * along;
  return slopes;
}

struct PrintDepartures {
  std::vector<PrintFault> faults;
  PrintCovariance covariance = PrintCovariance::Zero();
};

PrintDepartures departures_at(ceres::Problem& problem, const std::vector<ViewMeasurements>& frames,
                              const std::vector<std::vector<EdgeCost>>& edges, double loss_scale_sigmas,
                              SharedUnknowns& shared, std::vector<FrameUnknowns>& unknowns) {
  FittedNumbers numbers(problem);
  const auto print = shared.print();
  for (double* number : print) numbers.add(number);
  for (const TakenForZero& taken : shared.taken_for_zero()) numbers.add(taken.unknown);
  numbers.add(&shared.seam_lag_px);
  for (FrameUnknowns& frame : unknowns) {
    numbers.add(frame.pose.data()), numbers.add(&frame.film_sigmas);
    for (double& common_px : frame.common_px) numbers.add(&common_px);
  }
  LinearFit fit = linear_fit(problem, numbers);
  fit.noise = 0, fit.unmodelled_sigmas = unmodelled_sigmas, fit.alike_groups = alike_frames;
  for (const auto& of_frame : edges) fit.groups.push_back(of_frame.front().row);
  fit.groups.push_back(edges.back().back().row + 1);
  const auto [first, last] = std::ranges::minmax_element(frames, {}, &ViewMeasurements::time_s);
  const auto possible = possible_faults(first->time_s, last->time_s);
  Eigen::MatrixXd slopes = Eigen::MatrixXd::Zero(fit.residuals.size(), static_cast<Eigen::Index>(possible.size()));
  for (std::size_t i = 0; i < frames.size(); ++i)
    for (std::size_t k = 0; k < edges[i].size(); ++k) {
      if (edges[i][k].group >= boundaries) continue;
      slopes.row(edges[i][k].row) = trust(edges[i][k].cost->left(), loss_scale_sigmas) *
                                    slopes_of(frames[i].edges.all[k], frames[i].time_s, possible);
    }
  const Departures departures = departures_of(fit, slopes);
  PrintDepartures result;
  result.faults = seen_of(departures, possible);
  // Clean turns show some of hundredths of a millimetre; the covariance counts them.
  std::erase_if(result.faults, [](const PrintFault& fault) { return std::abs(fault.size) < least_edge_m; });
  if (departures.seen.empty()) return result;
  result.covariance = numbers.part_of(departures.by_seen + departures.by_instead, {print.begin(), print.end()});
  return result;
}

// The print's; the common errors count as they were before the fit.
std::optional<PrintCovariance> print_covariance(ceres::Problem& problem, SharedUnknowns& shared,
                                                const std::vector<TakenForZero>& errors, double noise_scale,
                                                const PrintCovariance& by_faults) {
  const auto numbers = shared.print();
  std::vector<const double*> unknowns(numbers.begin(), numbers.end());
  Eigen::VectorXd prior(static_cast<Eigen::Index>(errors.size()));
  for (std::size_t i = 0; i < errors.size(); ++i) {
    unknowns.push_back(errors[i].unknown);
    prior[static_cast<Eigen::Index>(i)] = errors[i].sigma;
  }
  const auto all = covariance_of(problem, unknowns);
  if (!all) return std::nullopt;
  const PrintCovariance joint = all->topLeftCorner<print_numbers, print_numbers>();
  const Eigen::MatrixXd cross = all->topRightCorner(print_numbers, prior.size());
  const Eigen::MatrixXd of_common = all->bottomRightCorner(prior.size(), prior.size());
  const Eigen::MatrixXd by_common = solve_symmetric(of_common, cross.transpose()).transpose();
  const PrintCovariance known = joint - by_common * cross.transpose();  // were the common errors known
  const PrintCovariance print = std::max(1.0, noise_scale * noise_scale) * known +
                                by_common * prior.cwiseAbs2().asDiagonal() * by_common.transpose() + by_faults;
  PrintNumbers units = PrintNumbers::Constant(mm);
  units[print_numbers - 1] = problem.IsParameterBlockConstant(&shared.gap_rad) ? 0 : 1;
  const PrintCovariance scaled = units.asDiagonal() * print * units.asDiagonal();
  return scaled.allFinite() ? std::optional(scaled) : std::nullopt;
}

// d(a boundary's place at either edge)/d(print_numbers).
PrintNumbers upper_row(int boundary) {
  return boundary == 0 ? PrintNumbers::Zero() : PrintNumbers(PrintNumbers::Unit(boundary - 1));
}
PrintNumbers lower_row(int boundary) {
  return PrintNumbers::Unit(3 + boundary);
}

}  // namespace

std::optional<Adjustment> adjust(const std::vector<ViewMeasurements>& frames, const Marker& marker,
                                 const AdjustmentOptions& options, const AtIteration& at_iteration) {
  SharedUnknowns shared;
  std::vector<FrameUnknowns> unknowns(frames.size());
  ceres::Problem problem;
  const bool free_lag = tells_lag(frames);
  add_priors(problem, shared, free_lag);
  const PrintShape shape = PrintShape::of(marker);
  std::vector<std::vector<EdgeCost>> edges;
  for (std::size_t i = 0; i < frames.size(); ++i)
    edges.push_back(
        add_frame(problem, frames[i], shape, marker.covered_rad(), options.loss_scale_sigmas, shared, unknowns[i]));
  for (double* number : shared.print())
    if (!options.free_print || (number == &shared.gap_rad && !options.free_gap))
      problem.SetParameterBlockConstant(number);

  const SolverChoice solver{ceres::SPARSE_NORMAL_CHOLESKY, 30, 1e-9};
  if (!solve_quietly(solver, problem, at_iteration).IsSolutionUsable()) return std::nullopt;

  Adjustment result;
  const double edges_px = sigma_of_edges_px(frames);
  result.lags = !free_lag && noise_beyond_usual(edges_px) > min_noise_of_lag;
  std::ranges::transform(shared.print(), result.print.begin(),
                         [&](const double* number) { return number == &shared.gap_rad ? *number : mm * *number; });
  std::vector<double> sigmas;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    UnknownVector& step = result.steps.emplace_back(pose_numbers + 1);
    step << Eigen::Map<const Eigen::Matrix<double, pose_numbers, 1>>(unknowns[i].pose.data()), unknowns[i].film_sigmas;
    auto& residuals_px = result.residuals_px.emplace_back();
    for (const auto& [cost, group, row] : edges[i]) {
      residuals_px.push_back(cost->left() * cost->sigma());
      if (group < 4) sigmas.push_back(cost->left());
    }
  }
  result.noise_scale = robust_scale(std::move(sigmas));
  if (options.with_covariance) {
    const PrintDepartures departures =
        departures_at(problem, frames, edges, options.loss_scale_sigmas, shared, unknowns);
    result.faults = departures.faults;
    result.covariance = print_covariance(problem, shared, common_errors(shared, frames, edges_px, free_lag),
                                         result.noise_scale, departures.covariance);
    if (!result.covariance) return std::nullopt;
  }
  return result;
}

PrintShape PrintShape::of(const Marker& marker) {
  PrintShape shape;
  shape.upper_m = boundaries_m(marker, 0);
  const auto slopes_m = boundary_slopes_m(marker);
  for (std::size_t k = 0; k < 4; ++k) shape.lower_m[k] = shape.upper_m[k] + slopes_m[k] * marker.covered_rad();
  shape.gap_rad = marker.gap_rad;
  return shape;
}

Marker PrintShape::on(Marker marker) const {
  for (std::size_t i = 0; i < 3; ++i) {
    marker.bands_upper_m[i] = upper_m[i + 1] - upper_m[i];
    marker.bands_lower_m[i] = lower_m[i + 1] - lower_m[i];
  }
  marker.wrap_m = lower_m[0];
  marker.skew_m = lower_m[3] - lower_m[0] - upper_m[3];
  marker.gap_rad = gap_rad;
  return marker;
}

PrintShape changed_by(const PrintShape& shape, const PrintNumbers& change) {
  PrintShape changed = shape;
  for (int k = 0; k < 4; ++k) {
    if (k > 0) changed.upper_m[static_cast<std::size_t>(k)] += change[k - 1];
    changed.lower_m[static_cast<std::size_t>(k)] += change[3 + k];
  }
  changed.gap_rad += change[7];
  return changed;
}

MarkerSigmas sigmas_of(const PrintCovariance& covariance, MarkerSigmas others) {
  const auto sigma = [&](const PrintNumbers& row) { return rounded_sigma(std::sqrt(row.dot(covariance * row))); };
  std::array<double, 3> upper{}, lower{};
  for (int i = 0; i < 3; ++i) {
    upper[static_cast<std::size_t>(i)] = sigma(upper_row(i + 1) - upper_row(i));
    lower[static_cast<std::size_t>(i)] = sigma(lower_row(i + 1) - lower_row(i));
  }
  others.bands_upper_m = upper, others.bands_lower_m = lower;
  others.wrap_m = sigma(lower_row(0));
  others.skew_m = sigma(lower_row(3) - lower_row(0) - upper_row(3));
  others.gap_rad = sigma(PrintNumbers::Unit(7));
  return others;
}

double tolerance_of(const PrintShape& shape, const PrintCovariance& covariance, const Marker& marker) {
  constexpr int steps = 36;
  const Marker printed = shape.on(marker);
  double variance = 0, of_a_metre = 0;
  for (int i = 0; i < steps; ++i) {
    const double fraction = (i + 0.5) / steps, tau_rad = fraction * printed.covered_rad();
    const auto by_boundaries = tau_by_boundaries(printed, tau_rad);
    PrintNumbers row = PrintNumbers::Zero();
    for (int k = 0; k < 4; ++k)
      row += by_boundaries[static_cast<std::size_t>(k)] * ((1 - fraction) * upper_row(k) + fraction * lower_row(k));
    variance += row.dot(covariance * row);
    const double unit_rad = predicted_print_error_rad(printed, tau_rad, 1);
    of_a_metre += unit_rad * unit_rad;
  }
  return rounded_sigma(std::sqrt(variance / of_a_metre));
}

}  // namespace lapservo::internal
