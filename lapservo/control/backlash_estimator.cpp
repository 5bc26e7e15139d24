#include "lapservo/control/backlash_estimator.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace lapservo::internal {

void BacklashEstimator::follow(const Eigen::Vector4d& q_joint) {
  for (int i = 0; i < 4; ++i) {
    Joint& joint = joints_[static_cast<std::size_t>(i)];
    const double measured = q_joint[i], largest = config_.largest[i];
    if (!followed_) joint.pressed = false, joint.lowest = joint.highest = measured;
    if (!(largest > 0)) continue;
    if (joint.pressed) {
      for (std::size_t k = 0; k < candidates; ++k) joint.grid[k].backlash.follow(measured, width(i, k));
      continue;
    }
    joint.lowest = std::min(joint.lowest, measured);
    joint.highest = std::max(joint.highest, measured);
    const int side = measured - joint.lowest > largest ? 1 : joint.highest - measured > largest ? -1 : 0;
    if (side == 0) continue;
    for (Candidate& candidate : joint.grid) candidate.backlash = Backlash(measured, side);
    joint.pressed = true;
    joint.since = 0;
  }
  followed_ = true;
  q_joint_ = q_joint;
}

void BacklashEstimator::add(double time_s, const Eigen::Vector4d& rate, const Eigen::Vector4d& q_image,
                            const Eigen::Matrix4d& covariance) {
  if (!followed_) return;
  for (int i = 0; i < 4; ++i) {
    Joint& joint = joints_[static_cast<std::size_t>(i)];
    if (!joint.pressed) continue;
    Nuisance nuisance;
    nuisance << q_joint_.cwiseQuotient(scales_.joints) * scales_.joints[i], rate[i];
    const double interval_s = joint.since > 0 ? std::max(0.0, time_s - joint.last_s) : 0.0;
    const double kept = std::exp(-interval_s / config_.forgetting_s);
    // A plain mean at first, a running one once the time constant has passed.
    const double fraction = std::max(1 / (1 + joint.since), -std::expm1(-interval_s / config_.offset_time_s));
    const double information =
        (1 - fraction) / std::max(covariance(i, i), 1e-6 * scales_.joints[i] * scales_.joints[i]);
    const Nuisance moved = nuisance - joint.mean;
    joint.mean += fraction * moved;
    joint.normal = kept * joint.normal + information * moved * moved.transpose();
    for (std::size_t k = 0; k < candidates; ++k) {
      Candidate& candidate = joint.grid[k];
      const double rest = q_image[i] - candidate.backlash.instrument(width(i, k)) - candidate.mean;
      candidate.mean += fraction * rest;
      candidate.squares = kept * candidate.squares + information * rest * rest;
      candidate.mixed = kept * candidate.mixed + information * rest * moved;
    }
    joint.weight = kept * joint.weight + 1;
    joint.since += 1;
    joint.last_s = time_s;
  }
}

std::optional<BacklashEstimate> BacklashEstimator::estimate(int index) const {
  const Joint& joint = joints_[static_cast<std::size_t>(index)];
  if (!(joint.weight > 0)) return std::nullopt;
  Nuisance prior;
  prior << Eigen::Vector4d::Constant(config_.model_error), config_.delay_error_s;
  Eigen::Matrix<double, 5, 5> normal = joint.normal;
  normal.diagonal() += prior.cwiseAbs2().cwiseInverse();
  const Eigen::LLT<Eigen::Matrix<double, 5, 5>> factor(normal);
  std::array<double, candidates> squares;
  for (std::size_t k = 0; k < candidates; ++k) {
    const Candidate& candidate = joint.grid[k];
    squares[k] = candidate.squares - candidate.mixed.dot(factor.solve(candidate.mixed));
  }
  const auto lowest = static_cast<std::size_t>(std::min_element(squares.begin(), squares.end()) - squares.begin());
  const std::size_t middle = std::clamp<std::size_t>(lowest, 1, candidates - 2);
  const double step = width(index, 1);
  const double left = squares[middle - 1], centre = squares[middle], right = squares[middle + 1];
  const double curvature = (left - 2 * centre + right) / (step * step);
  if (!(curvature > 0)) return std::nullopt;
  const double shift = (left - right) / (2 * step * curvature);
  // A sum of squares grows by 1 at one sigma. Noise persists over several frames. A residual beyond the noise
  // persists over whole swings: it looks as much like a gap as smooth motions look like one another. departures_of()
  // can't name its cause: those that it could look for are nuisances already.
  constexpr double frames_alike = 4, likeness = 0.3;
  const double beyond_noise = std::max(0.0, squares[lowest] - joint.weight);
  return BacklashEstimate{std::clamp(width(index, middle) + shift, 0.0, config_.largest[index]),
                          std::sqrt(2 / curvature * (frames_alike + likeness * likeness * beyond_noise))};
}

}  // namespace lapservo::internal
