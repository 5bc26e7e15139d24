#include "lapservo/rcm/projected_rcm.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/departures.h"
#include "lapservo/core/error.h"
#include "lapservo/core/random.h"
#include "lapservo/core/words.h"

namespace lapservo {
using namespace internal;
namespace {

constexpr std::size_t min_for_outliers = 6;
constexpr double outlier_sigmas = 3.5;

using Lines = std::vector<LineObservation>;

// How many of its own standard deviations a line passes by o, and how that moves with o and, per pixel across the line,
// with its two ends.
struct Miss {
  double sigmas;
  Eigen::Vector2d d_sigmas_d_o;
  Eigen::Vector2d d_sigmas_d_ends;
};

Miss miss(const LineObservation& line, const Eigen::Vector2d& o) {
  const auto across = [](const Eigen::Vector2d& v) { return Eigen::Vector2d(v.y(), -v.x()); };
  const Eigen::Vector2d along = line.to_px - line.from_px, arm = o - line.from_px;
  Eigen::Vector4d h;
  h << across(line.to_px - o), across(arm);
  const double g = along.x() * arm.y() - along.y() * arm.x();
  const Eigen::Vector4d weighted = line.covariance_px2 * h;
  const double sigma = std::sqrt(std::max(h.dot(weighted), std::numeric_limits<double>::min()));
  const double pull = g / (sigma * sigma);
  // d(h)/d(o) maps v to [-across(v); across(v)], whose transpose acts on `weighted`.
  const Eigen::Vector2d d_sigma2_half = across(weighted.head<2>() - weighted.tail<2>());
  const Eigen::Vector2d normal = across(along).normalized();
  return {g / sigma,
          (-across(along) - pull * d_sigma2_half) / sigma,
          {h.head<2>().dot(normal) / sigma, h.tail<2>().dot(normal) / sigma}};
}

double chi2_at(const Lines& lines, const Eigen::Vector2d& o) {
  double chi2 = 0;
  for (const LineObservation& line : lines) chi2 += std::pow(miss(line, o).sigmas, 2);
  return chi2;
}

struct Fit {
  bool converged = false;
  Eigen::Vector2d point_px;
  Eigen::Matrix2d information;
  double chi2;
};

// Gauss-Newton; a step is halved until it helps.
Fit fit(const Lines& lines, Eigen::Vector2d o) {
  Fit result{false, o, Eigen::Matrix2d::Zero(), chi2_at(lines, o)};
  for (int iteration = 0; iteration < 100; ++iteration) {
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
    Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
    for (const LineObservation& line : lines) {
      const Miss m = miss(line, result.point_px);
      information += m.d_sigmas_d_o * m.d_sigmas_d_o.transpose();
      gradient += m.sigmas * m.d_sigmas_d_o;
    }
    result.information = information;
    Eigen::Vector2d step = -information.ldlt().solve(gradient);
    if (!step.allFinite()) return result;
    const double rounding_px = 1e-9 * (1 + result.point_px.norm());
    while (step.norm() > rounding_px && !(chi2_at(lines, result.point_px + step) < result.chi2)) step /= 2;
    if (step.norm() <= rounding_px) {
      result.converged = true;
      return result;
    }
    result.point_px += step;
    result.chi2 = chi2_at(lines, result.point_px);
  }
  return result;
}

struct Start {
  Eigen::Vector2d point_px;
  double median_sigmas;
};

// Over all pairs, or as many random ones as make it sure to meet two good lines.
std::optional<Start> min_median_start(const Lines& lines) {
  constexpr std::size_t max_pairs = 600;
  std::optional<Start> best;
  std::vector<double> misses(lines.size());
  const auto consider = [&](std::size_t i, std::size_t k) {
    const auto o = intersection_px(lines[i], lines[k]);
    if (!o) return;
    for (std::size_t n = 0; n < lines.size(); ++n) misses[n] = std::abs(miss(lines[n], *o).sigmas);
    const auto middle = misses.begin() + static_cast<std::ptrdiff_t>(std::min(lines.size() / 2 + 1, lines.size() - 1));
    std::nth_element(misses.begin(), middle, misses.end());
    if (!best || *middle < best->median_sigmas) best = Start{*o, *middle};
  };
  if (lines.size() * (lines.size() - 1) / 2 <= max_pairs) {
    for (std::size_t i = 0; i < lines.size(); ++i)
      for (std::size_t k = i + 1; k < lines.size(); ++k) consider(i, k);
    return best;
  }
  constexpr std::uint64_t seed = 1;
  Random random(seed);
  for (std::size_t pair = 0; pair < max_pairs; ++pair)
    consider(random.bits() % lines.size(), random.bits() % lines.size());
  return best;
}

// The same standard deviation of the misses, from their median (Rousseeuw and Leroy 1987, with their small-sample
// factor).
double first_scale(const Start& start, std::size_t lines) {
  return 1.4826 * (1 + 5 / static_cast<double>(lines - 2)) * start.median_sigmas;
}

double scale_of(double chi2, std::size_t lines) {
  return lines > 2 ? std::sqrt(chi2 / static_cast<double>(lines - 2)) : 1;
}

struct RobustFit {
  Fit fit;
  std::vector<bool> used;  // per line
};

// Refits to what lies within the limit, which follows the scale, until the choice stays the same.
RobustFit fit_robustly(const Lines& lines, const Start& start, NoiseScale scale) {
  constexpr double min_scale = 1e-6;  // lines that meet to rounding have no noise to be estimated from
  RobustFit robust{{false, start.point_px, Eigen::Matrix2d::Zero(), 0}, std::vector<bool>(lines.size(), true)};
  if (lines.size() < min_for_outliers) {
    robust.fit = fit(lines, start.point_px);
    return robust;
  }
  double scale_now = std::max(first_scale(start, lines.size()), scale == NoiseScale::known ? 1 : min_scale);
  for (int round = 0; round < 20; ++round) {
    const std::vector<bool> before = std::exchange(robust.used, {});
    Lines inside;
    for (const LineObservation& line : lines) {
      robust.used.push_back(std::abs(miss(line, robust.fit.point_px).sigmas) <= outlier_sigmas * scale_now);
      if (robust.used.back()) inside.push_back(line);
    }
    if (inside.size() < 2 || (round > 0 && robust.used == before)) return robust;
    robust.fit = fit(inside, robust.fit.point_px);
    if (!robust.fit.converged) return robust;
    scale_now = scale == NoiseScale::known ? 1 : std::max(scale_of(robust.fit.chi2, inside.size()), min_scale);
  }
  return robust;
}

// Error of the estimate for an error of one pixel that the lines share at their first ends, and one at their second.
Eigen::Matrix2d common_covariance(const Lines& lines, const Eigen::Vector2d& o, const Eigen::Matrix2d& covariance) {
  Eigen::Matrix2d pull = Eigen::Matrix2d::Zero();
  for (const LineObservation& line : lines) {
    const Miss m = miss(line, o);
    pull += m.d_sigmas_d_o * m.d_sigmas_d_ends.transpose();
  }
  const Eigen::Matrix2d shift = covariance * pull;
  return shift * shift.transpose();
}

// In rising order.
Eigen::Vector2d eigenvalues(const Eigen::Matrix2d& matrix) {
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>().computeDirect(matrix, Eigen::EigenvaluesOnly).eigenvalues();
}

double direction_spread_rad(const Lines& lines) {
  Eigen::Matrix2d mean = Eigen::Matrix2d::Zero();
  for (const LineObservation& line : lines) {
    const Eigen::Vector2d along = (line.to_px - line.from_px).normalized();
    mean += along * along.transpose() / static_cast<double>(lines.size());
  }
  return std::asin(std::sqrt(std::clamp(eigenvalues(mean)[0], 0.0, 1.0)));
}

// From the observed points to o; within the image of the shafts their length stands in.
double lever_px(const Lines& lines, const Eigen::Vector2d& o) {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  double length_px = 0;
  for (const LineObservation& line : lines) {
    middle += (line.from_px + line.to_px) / 2 / static_cast<double>(lines.size());
    length_px += (line.to_px - line.from_px).norm() / static_cast<double>(lines.size());
  }
  return std::max((o - middle).norm(), length_px);
}

// More than a third left out, or the others beyond three sigmas of chance (Wilson and Hilferty 1931).
bool is_beyond_noise(const RobustFit& robust) {
  const auto inside = static_cast<double>(std::count(robust.used.begin(), robust.used.end(), true));
  if (3 * inside < 2 * static_cast<double>(robust.used.size())) return true;
  const double freedom = inside - 2, part = 2 / (9 * std::max(1.0, freedom));
  return freedom > 0 && robust.fit.chi2 > freedom * std::pow(1 - part + 3 * std::sqrt(part), 3);
}

// Slopes of each line's miss by the bend at the border of the observed points, and by the distance of the first and of
// the second ends from the lines (px).
Eigen::Matrix<double, Eigen::Dynamic, 3> slopes_by_ends(const Lines& lines, const Eigen::Vector2d& o) {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const LineObservation& line : lines)
    middle += (line.from_px + line.to_px) / 2 / static_cast<double>(lines.size());
  double border_px = 1;
  for (const LineObservation& line : lines)
    border_px = std::max({border_px, (line.from_px - middle).norm(), (line.to_px - middle).norm()});
  Eigen::Matrix<double, Eigen::Dynamic, 3> slopes(lines.size(), 3);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const Eigen::Vector2d along = (lines[i].to_px - lines[i].from_px).normalized(), normal(along.y(), -along.x());
    const auto bent = [&](const Eigen::Vector2d& end_px) {
      const Eigen::Vector2d at = (end_px - middle) / border_px;
      return at.squaredNorm() * at.dot(normal);
    };
    const Eigen::Vector2d by_ends = miss(lines[i], o).d_sigmas_d_ends;
    slopes.row(static_cast<Eigen::Index>(i))
        << by_ends.dot(Eigen::Vector2d(bent(lines[i].from_px), bent(lines[i].to_px))),
        by_ends.transpose();
  }
  return slopes;
}

std::string text_of(const Fault& fault) {
  const double px = std::abs(fault.size);
  if (fault.which == 0)
    return fmt::format(
        "the RCM moves by {:.2g} px in the image from the first line to the last: fasten the trocar, the endoscope and "
        "the arm's base, and record again",
        px);
  if (fault.which == 1)
    return fmt::format(
        "the lines bend as by a lens, by {:.2g} px at the border of the observed points: undistort them by a "
        "calibration of this camera",
        px);
  return fmt::format(
      "the lines pass the RCM on one side, one end of all of them is {:.2g} px beside the shaft's axis: light the "
      "shaft evenly, mount the marker straight",
      px);
}

// Finds the faults that lines through one point do not have, where there are enough lines to distinguish them.
void count_departures(const Lines& lines, RcmEstimate& estimate) {
  constexpr std::size_t enough = 12;
  if (lines.size() < enough) return;
  // How the lines' misses move with the point, and what a steady motion of the point adds from the first line to the
  // last (px): it lies as far from the middle of the motion as the other lines' do, rms, so that sigma counts the
  // motion.
  Eigen::VectorXd sigmas(lines.size());
  Eigen::MatrixXd slopes(lines.size(), 4);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const Miss m = miss(lines[i], estimate.point_px);
    const double time = (static_cast<double>(i) + 0.5) / static_cast<double>(lines.size());
    sigmas[i] = m.sigmas;
    slopes.row(i) << m.d_sigmas_d_o.transpose(), (time - 0.5 - 1 / std::sqrt(12.0)) * m.d_sigmas_d_o.transpose();
  }
  // The likeliest motion, and its covariance for misses of unit noise.
  const Eigen::MatrixXd covariance = inverse_of_symmetric(product(slopes.transpose(), slopes));
  const Eigen::Vector2d motion_px = -product(covariance, product(slopes.transpose(), sigmas)).bottomRows(2);
  const Eigen::Matrix2d motion_covariance_px2 = covariance.bottomRightCorner(2, 2);
  LinearFit fit;
  fit.residuals = sigmas, fit.jacobian = slopes.leftCols(2).sparseView();
  fit.noise = std::max(1e-9, estimate.noise_factor);
  slopes << product(slopes.rightCols(2), motion_px.normalized()), slopes_by_ends(lines, estimate.point_px);
  const Departures departures = departures_of(fit, slopes);
  *estimate.covariance_px2 += departures.by_seen + departures.by_instead;
  for (const Fault& fault : departures.seen) {
    estimate.faults.push_back(text_of(fault));
    // In which direction it moves is not known either.
    if (fault.which == 0) *estimate.covariance_px2 += fit.noise * fit.noise * motion_covariance_px2 / 12;
  }
}

}  // namespace

std::string_view to_string(RcmStatus status) {
  return word_of(names_up_to<RcmStatus::not_converged>, status);
}

RcmEstimate estimate_projected_rcm(std::span<const LineObservation> given, const RcmOptions& options) {
  if (!(options.common_px >= 0) || !std::isfinite(options.common_px))
    throw InputError("estimate_rcm", "common_px", fmt::format("{}", options.common_px), "0 or more pixels");
  RcmEstimate estimate;
  estimate.used.assign(given.size(), false);
  Lines lines;
  std::copy_if(given.begin(), given.end(), std::back_inserter(lines), is_usable);
  estimate.lines = lines.size();
  if (lines.size() < 2) return estimate;
  const auto start = min_median_start(lines);
  if (!start) {
    estimate.status = RcmStatus::parallel;
    return estimate;
  }
  RobustFit robust = fit_robustly(lines, *start, options.scale);
  const bool beyond = options.scale == NoiseScale::known && robust.fit.converged && is_beyond_noise(robust);
  if (beyond) robust = fit_robustly(lines, *start, NoiseScale::estimated);
  const auto& [best, used] = robust;
  const Eigen::Matrix2d as_given = best.information.inverse();
  if (!best.converged || !best.point_px.allFinite() || !as_given.allFinite()) {
    estimate.status = RcmStatus::not_converged;
    return estimate;
  }
  Lines inside;
  for (std::size_t i = 0, usable = 0; i < given.size(); ++i) {
    estimate.used[i] = is_usable(given[i]) && used[usable++];
    if (estimate.used[i]) inside.push_back(given[i]);
  }
  estimate.outliers = lines.size() - inside.size();
  estimate.point_px = best.point_px;
  estimate.chi2 = best.chi2;
  estimate.degrees_of_freedom = static_cast<int>(inside.size()) - 2;
  estimate.direction_spread_rad = direction_spread_rad(inside);
  if (options.scale == NoiseScale::estimated || beyond) estimate.noise_factor = scale_of(best.chi2, inside.size());
  if (options.scale == NoiseScale::known || estimate.degrees_of_freedom > 0)
    estimate.covariance_px2 =
        estimate.noise_factor * estimate.noise_factor * as_given +
        options.common_px * options.common_px * common_covariance(inside, best.point_px, as_given);
  if (estimate.covariance_px2) count_departures(inside, estimate);
  if (beyond && estimate.faults.empty())
    estimate.faults.push_back(fmt::format(
        "the lines miss one another by {:.2g} times their own sigmas, which are too small", estimate.noise_factor));
  const double fraction = estimate.covariance_px2
                              ? std::sqrt(eigenvalues(*estimate.covariance_px2)[1]) / lever_px(inside, best.point_px)
                              : 0;
  estimate.near_parallel = estimate.direction_spread_rad < near_parallel_rad || fraction > near_parallel_fraction;
  const bool parallel = !(fraction < 1) || estimate.direction_spread_rad < parallel_rad;
  estimate.status = parallel ? RcmStatus::parallel : RcmStatus::ok;
  return estimate;
}

}  // namespace lapservo
