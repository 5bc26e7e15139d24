#include "lapservo/control/probing.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "lapservo/control/tracking_law.h"
#include "lapservo/core/angles.h"

namespace lapservo::internal {

void AffineFit::add(const Eigen::Vector4d& x, const ImageVector& y) {
  Eigen::Matrix<double, 5, 1> regressor;
  regressor << 1, x;
  normal_.noalias() += regressor * regressor.transpose();
  mixed_.noalias() += regressor * y.transpose();
  squares_ += y.squaredNorm();
  ++samples_;
}

std::optional<AffineFit::Solution> AffineFit::solve() const {
  if (samples_ < 10) return std::nullopt;
  const Eigen::LDLT<Eigen::Matrix<double, 5, 5>> factor(normal_);
  // Each input must have moved by about 1 % of its scale, root of the mean square.
  if (factor.info() != Eigen::Success || factor.vectorD().minCoeff() < 1e-4 * samples_) return std::nullopt;
  const Eigen::Matrix<double, 5, 8> parameters = factor.solve(mixed_);
  Solution solution;
  solution.at_zero = parameters.row(0);
  solution.gradient = parameters.bottomRows<4>().transpose();
  solution.covariance = factor.solve(Eigen::Matrix<double, 5, 5>::Identity());
  solution.squares = squares_ - parameters.cwiseProduct(mixed_).sum();
  return solution;
}

ProbingMotion::ProbingMotion(const ProbingConfig& config, const JointLimits& limits, const Eigen::Vector4d& q_joint,
                             const Eigen::Vector4d& side)
    : joint_time_s_(config.joint_time_s) {
  const Eigen::Vector4d middle = (limits.lower + limits.upper) / 2;
  for (int i = 0; i < 4; ++i) distance_[i] = q_joint[i] > middle[i] ? -config.distance[i] : config.distance[i];
  distance_ = distance_.cwiseProduct(side);
}

Eigen::Vector4d ProbingMotion::velocity(double time_s) const {
  Eigen::Vector4d result = Eigen::Vector4d::Zero();
  const double turn = time_s / joint_time_s_;
  if (!(turn >= 0) || turn >= 4) return result;
  const int joint = static_cast<int>(turn);
  result[joint] = distance_[joint] * (pi / joint_time_s_) * std::sin(two_pi * (turn - joint));
  return result;
}

double ProbingMotion::way_back_s(double time_s) const {
  const double turn = time_s / joint_time_s_, begin = std::floor(turn);
  if (!(turn >= 0) || turn >= 4 || turn - begin >= 0.5) return time_s;
  return joint_time_s_ * (2 * begin + 1 - turn);
}

double ProbingMotion::duration_s() const {
  return 4 * joint_time_s_ + ProbingFit::step_s * static_cast<double>(ProbingFit::candidates);
}

void ProbingFit::add(double stamp_s, const Eigen::Vector4d& features, const Eigen::Vector4d& ends_px,
                     const JointHistory& history) {
  if (history.size() == 0 || history.oldest_s() > stamp_s - candidate_s(used() - 1)) return;
  if (!started_) {
    first_q_ = *history.at(stamp_s - candidate_s(0));
    first_features_ = features;
    first_ends_px_ = ends_px;
    started_ = true;
  }
  ImageVector y;
  y << feature_error(features, first_features_).cwiseQuotient(scales_.features), ends_px - first_ends_px_;
  for (std::size_t i = 0; i < used(); ++i) {
    const Eigen::Vector4d q = *history.at(stamp_s - candidate_s(i));
    fits_[i].add((q - first_q_).cwiseQuotient(scales_.joints), y);
  }
}

std::optional<ProbedModel> ProbingFit::solve() const {
  std::size_t best = 0;
  std::array<double, candidates> squares{};
  for (std::size_t i = 0; i < used(); ++i) {
    const auto solution = fits_[i].solve();
    if (!solution) return std::nullopt;
    squares[i] = solution->squares;
    if (squares[i] < squares[best]) best = i;
  }
  ProbedModel model{first_q_, *fits_[best].solve(), candidate_s(best)};
  model.fit.at_zero.head<4>() += first_features_.cwiseQuotient(scales_.features);
  model.fit.at_zero.tail<4>() += first_ends_px_;
  if (known_delay_s_ || best == 0) return model;
  if (best + 1 == candidates) return std::nullopt;
  const double left = squares[best - 1], right = squares[best + 1];
  const double bend = left - 2 * squares[best] + right;
  if (bend > 0) model.delay_s += std::clamp((left - right) / (2 * bend), -0.5, 0.5) * step_s;
  return model;
}

// The answer to one joint gives the delay of the images.
void ProbingResponse::begin(Eigen::Index joint, const ImageMeasurement& image, const JointHistory& history) {
  constexpr double unsure_s = 0.1;
  const bool first = joint_ < 0;
  const double longest_s = answered_ ? std::min(longest_s_, delay_s_ + unsure_s) : longest_s_;
  *this = ProbingResponse(path_, longest_s);
  joint_ = joint;
  waits_ = !first;
  begun_s_ = image.time_s;
  q_first_ = (*history.newest())[joint];
  features_ = image.features;
}

void ProbingResponse::add(Eigen::Index joint, const ImageMeasurement& image, const JointHistory& history) {
  constexpr double plain = 6;        // standard deviations
  constexpr double settled_s = 0.1;  // an arm that is sent to rest
  if (joint != joint_) begin(joint, image, history);
  waits_ = waits_ && image.time_s - begun_s_ < longest_s_ + settled_s;
  if (!history.at(image.time_s - longest_s_) || waits_) return;
  const Eigen::Array4d sigma = image.covariance.diagonal().array().sqrt();
  const Eigen::Array4d y = feature_error(image.features, features_).array() / sigma;
  count_ += 1;
  plainest_ = 0;
  for (std::size_t i = 0; i < candidates; ++i) {
    const double x = (*history.at(image.time_s - delay_s(i)))[joint] - q_first_;
    Sums& sum = sums_[i];
    sum.x += x, sum.xx += x * x, sum.y += y, sum.xy += x * y;
    const double squares = sum.xx - sum.x * sum.x / count_;
    const Eigen::Array4d product = sum.xy - sum.x * sum.y / count_;
    if (!(count_ > 2 && squares > 0)) continue;
    const double found = product.abs().maxCoeff() / std::sqrt(squares);
    if (found > plainest_) plainest_ = found, delay_s_ = delay_s(i);
  }
  answered_ = answered_ || plainest_ > plain;
  unanswered_ = !answered_ && std::abs((*history.newest())[joint] - q_first_) > path_[joint];
}

}  // namespace lapservo::internal
