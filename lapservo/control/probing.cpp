#include "lapservo/control/probing.h"

#include <algorithm>
#include <cmath>

#include "lapservo/control/tracking_law.h"
#include "lapservo/core/angles.h"

namespace lapservo::internal {

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

}  // namespace lapservo::internal
