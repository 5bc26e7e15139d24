#include "lapservo/control/delay_estimator.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "lapservo/core/departures.h"

namespace lapservo::internal {
namespace {

constexpr double frames_alike = 4;  // whose errors are the same

template <class Grid>
auto likeliest(const Grid& grid) {
  return std::min_element(grid.begin(), grid.end(), [](const auto& a, const auto& b) { return a.squares < b.squares; });
}

}  // namespace

void DelayEstimator::add(double stamp_s, const Eigen::Vector4d& q_image, const Eigen::Matrix4d& covariance,
                         const JointHistory& history) {
  if (history.size() == 0 || history.oldest_s() > stamp_s - longest_s) return;
  const Eigen::Matrix4d noise = covariance + Eigen::Matrix4d(config_.measured_sigma.cwiseAbs2().asDiagonal());
  const Eigen::Matrix4d information = noise.inverse();
  const double interval_s = weight_ > 0 ? std::max(0.0, stamp_s - last_stamp_s_) : 0.0;
  const double kept = std::exp(-interval_s / config_.forgetting_s);
  // A plain mean at first, a running one once the time constant has passed.
  const double fraction = std::max(1 / (1 + since_), -std::expm1(-interval_s / config_.offset_time_s));
  const Eigen::Vector4d moved = q_image - mean_;
  for (std::size_t i = 0; i < candidates; ++i) {
    Candidate& candidate = grid_[i];
    const Eigen::Vector4d difference = q_image - *history.at(stamp_s - step_s * static_cast<double>(i));
    const Eigen::Vector4d before = difference - candidate.mean;
    candidate.mean += fraction * before;
    candidate.squares = kept * candidate.squares + (1 - fraction) * before.dot(information * before);
    candidate.mixed = kept * candidate.mixed + (1 - fraction) * moved * (information * before).transpose();
  }
  const Eigen::Matrix4d places = (1 - fraction) * moved * moved.transpose();
  for (Eigen::Index i = 0; i < 4; ++i)
    for (Eigen::Index j = 0; j < 4; ++j)
      by_model_.block<4, 4>(4 * i, 4 * j) = kept * by_model_.block<4, 4>(4 * i, 4 * j) + information(i, j) * places;
  mean_ += fraction * moved;
  squares_ = kept * squares_ + (1 - fraction) * moved.dot(information * moved);
  const Eigen::Vector4d rate = (*history.at(stamp_s) - *history.at(stamp_s - longest_s)) / longest_s;
  information_per_s2_ = kept * information_per_s2_ + (1 - fraction) * rate.dot(information * rate);
  weight_ = kept * weight_ + 1;
  since_ += 1;
  seen_s_ += interval_s;
  last_stamp_s_ = stamp_s;
}

// The square of the delay's error by a wrong model, where it shows: each joint's place in the image may be off by a
// multiple of each joint's. The estimator keeps sums of squares and products, not frames: each matrix that has the same
// products gives the same fit.
double DelayEstimator::variance_by_model(const Lowest& at) const {
  constexpr Eigen::Index faults = 16, all = faults + 2;
  const double curvature = at.curvature, shift_s = at.shift_s;
  const Candidate &left = grid_[at.candidate - 1], &centre = grid_[at.candidate], &right = grid_[at.candidate + 1];
  const Eigen::Matrix4d by_delay = (right.mixed - left.mixed) / (2 * step_s), mixed = centre.mixed + shift_s * by_delay;
  Eigen::Matrix<double, all, all> products = Eigen::Matrix<double, all, all>::Zero();
  products(0, 0) = curvature / 2;
  products.block<faults, 1>(1, 0) = by_delay.reshaped();
  products.block<faults, faults>(1, 1) = by_model_;
  products.block<1, faults>(all - 1, 1) = mixed.reshaped().transpose();
  products(all - 1, all - 1) = centre.squares - shift_s * shift_s * curvature / 2;
  const Eigen::LDLT<Eigen::Matrix<double, all, all>> factor(products);
  Eigen::MatrixXd rows = factor.transpositionsP().transpose() * Eigen::MatrixXd(factor.matrixL());
  rows = (rows * factor.vectorD().cwiseMax(0).cwiseSqrt().asDiagonal()).transpose().eval();
  LinearFit fit;
  fit.jacobian = rows.leftCols(1).sparseView(), fit.residuals = rows.col(all - 1);
  fit.noise = std::sqrt(frames_alike);
  const Departures departures = departures_of(fit, rows.middleCols(1, faults));
  return departures.by_seen(0, 0) + departures.by_instead(0, 0);
}

std::optional<DelayEstimator::Lowest> DelayEstimator::lowest() const {
  if (seen_s_ < config_.min_time_s) return std::nullopt;
  const auto lowest = likeliest(grid_);
  const auto index = static_cast<std::size_t>(lowest - grid_.begin());
  const std::size_t middle = std::clamp<std::size_t>(index, 1, candidates - 2);
  const double left = grid_[middle - 1].squares, centre = grid_[middle].squares, right = grid_[middle + 1].squares;
  const double curvature = (left - 2 * centre + right) / (step_s * step_s);
  if (!(curvature > 0)) return std::nullopt;
  const double shift_s = (left - right) / (2 * step_s * curvature);
  const double delay_s = std::clamp(step_s * static_cast<double>(middle) + shift_s, 0.0, longest_s);
  // A sum of squares grows by 1 at one sigma. A residual that the measured joints do not explain counts as noise that
  // persists over several frames.
  const double misfit = std::max(1.0, lowest->squares / (4 * weight_));
  return Lowest{middle, curvature, shift_s, delay_s, 2 / curvature * misfit * frames_alike};
}

std::optional<DelayEstimate> DelayEstimator::estimate() const {
  const auto found = lowest();
  // A wrong model only adds to it, and costs a factorisation to ask.
  if (!found || !(found->by_noise_s2 <= config_.max_sigma_s * config_.max_sigma_s)) return std::nullopt;
  const double sigma_s = std::sqrt(found->by_noise_s2 + variance_by_model(*found));
  if (!(sigma_s <= config_.max_sigma_s)) return std::nullopt;
  return DelayEstimate{found->delay_s, sigma_s};
}

bool DelayEstimator::contradicts(double delay_s) const {
  constexpr double sure = 4;
  const auto found = lowest();
  if (!found) return false;
  const double apart_s = std::abs(found->delay_s - delay_s), sure_s2 = std::pow(apart_s / sure, 2);
  return apart_s > sure * config_.max_sigma_s && found->by_noise_s2 < sure_s2 &&
         found->by_noise_s2 + variance_by_model(*found) < sure_s2;
}

bool DelayEstimator::is_contradicted() const {
  constexpr double times = 5, min_time_s = 5, unexplained = 0.5, misfit = 9;
  const double expected_sigma_s = std::sqrt(frames_alike / information_per_s2_);
  if (!(seen_s_ > min_time_s && times * expected_sigma_s < config_.max_sigma_s)) return false;
  const auto lowest = likeliest(grid_);
  const bool at_end = lowest + 1 == grid_.end();
  return lowest->squares > misfit * 4 * weight_ && (at_end || lowest->squares > unexplained * squares_);
}

}  // namespace lapservo::internal
