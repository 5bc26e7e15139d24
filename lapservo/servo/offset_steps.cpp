#include "lapservo/servo/offset_steps.h"

#include <algorithm>
#include <cmath>

#include "lapservo/core/dense_matrix.h"

namespace lapservo::internal {
namespace {

// The latest image may be older than the others: the loop runs at 10 images a second, of which one may be missing.
constexpr double memory_s = 0.1, latest_memory_s = 0.2;

// Standard deviations: of a step at least (rad, rad, m, rad); of late stamps beside their scatter; of a delay that is a
// guess, and of one that is known.
const Eigen::Array4d least_sigma(1.25e-4, 1.25e-4, 2.5e-5, 5e-5);
constexpr double late_s = 0.001, guessed_delay_s = 0.08, known_delay_s = 0.01;

// As parts of the path of the joints: by a wrong registration or lens, and for rho by all of its play. A step that is
// proportional to the path is no moved endoscope.
const Eigen::Array4d of_path(0.017, 0.017, 0.083, 5e-4), of_path_suspected(0.083, 0.083, 0.083, 2e-3);
constexpr double unusual = 6, weight = 0.05;

// A gradual change is learnt so much later.
constexpr double learnt_after_s = 0.5;

// One joint's own is what the others show less of than this part of it, beside their path and what is usual.
constexpr double beside = 0.02, beside_of_path = 0.005, beside_usual = 2;

}  // namespace

bool OffsetSteps::add(const SeenOffset& offset, bool delay_is_known) {
  Seen now{offset};
  if (!seen_.empty()) now.path = seen_.back().path + (offset.measured - seen_.back().at.measured).cwiseAbs();
  const auto is_compared = [&] {
    return offset.stamp_s - seen_.front().at.stamp_s < (seen_.size() > 1 ? memory_s : latest_memory_s);
  };
  while (!seen_.empty() && !is_compared()) seen_.pop_front();
  // A stamp that is missing or not newer carries no information.
  if (!seen_.empty() && !(offset.stamp_s > seen_.back().at.stamp_s)) return false;
  if (!latest_.empty() && !(offset.stamp_s > latest_.back().stamp_s)) latest_.clear();
  if (!seen_.empty()) {
    const Change step = change(oldest(), now, delay_is_known);
    now.unusual = step.sigmas > unusual;
    if (!now.unusual) learn(step, delay_is_known);
  }
  // It is there again, or rests elsewhere.
  if (!now.unusual) std::erase_if(seen_, [](const Seen& seen) { return seen.unusual; });
  seen_.push_back(now);
  return now.unusual;
}

// While the delay is a guess, what that makes of motion can't wait.
void OffsetSteps::learn(const Change& change, bool delay_is_known) {
  const auto learn_now = [this](const Change& seen) {
    step_squared_ += weight * (seen.unexplained.square() - step_squared_);
    late_s2_ += weight * (seen.late_s * seen.late_s - late_s2_);
  };
  if (!delay_is_known || is_of_one_joint(change)) return learn_now(change);
  latest_.push_back(change);
  while (change.stamp_s - latest_.front().stamp_s > learnt_after_s) {
    learn_now(latest_.front());
    latest_.pop_front();
  }
}

bool OffsetSteps::is_of_one_joint(const Change& change) const {
  const Eigen::Array4d expected = beside_usual * step_squared_.sqrt() + beside_of_path * change.path;
  const auto of_one = [&](const Eigen::Array4d& step) {
    Eigen::Index most = 0;
    const Eigen::Array4d size = step.abs() / least_sigma;
    const double allowed = beside * size.maxCoeff(&most);
    Eigen::Array4d others = (step.abs() - expected) / least_sigma;
    others[most] = 0;
    return others.maxCoeff() < allowed;
  };
  return of_one(change.unexplained) || of_one(change.seen);
}

// The oldest usual one; where none is, the oldest.
const OffsetSteps::Seen& OffsetSteps::oldest() const {
  const auto found = std::find_if(seen_.begin(), seen_.end(), [](const Seen& seen) { return !seen.unusual; });
  return found == seen_.end() ? seen_.front() : *found;
}

// A late image shows the joints at another time: all of them off along their motion; a wrong delay does the same where
// the motion changed.
OffsetSteps::Change OffsetSteps::change(const Seen& before, const Seen& now, bool delay_is_known) const {
  const Eigen::Vector4d rate = now.at.rate_per_s, rates = now.at.rate_per_s - before.at.rate_per_s;
  Change change{now.at.stamp_s};
  change.seen = now.at.offset - before.at.offset;
  const Eigen::Vector4d path = now.path - before.path;
  const double turned = path.head<2>().maxCoeff();  // theta's and phi's, where the frame is off
  change.path << turned, turned, path[2], turned;
  const Eigen::Array4d& share = seen_.back().unusual ? of_path_suspected : of_path;
  const double late = late_s * late_s + late_s2_, delay_s = delay_is_known ? known_delay_s : guessed_delay_s;
  Eigen::Matrix4d covariance = before.at.covariance + now.at.covariance + late * rate * rate.transpose() +
                               delay_s * delay_s * rates * rates.transpose();
  covariance.diagonal().array() += least_sigma.square() + step_squared_ + (share * change.path).square();
  const Eigen::Vector4d weighed = solve_symmetric(covariance, change.seen.matrix());
  change.sigmas = std::sqrt(change.seen.matrix().dot(weighed));
  change.late_s = late * rate.dot(weighed);
  change.unexplained = change.seen.matrix() - change.late_s * rate - delay_s * delay_s * rates.dot(weighed) * rates;
  return change;
}

}  // namespace lapservo::internal
