#include "lapservo/servo/offset_steps.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace lapservo::internal {
namespace {

constexpr double memory_s = 0.1;

// Smaller steps are insignificant: theta, phi (rad), rho (m), of which this is also the scale.
const Eigen::Array3d min_step(7.5e-4, 7.5e-4, 1.5e-4);
// Fractions of the path of the joints: a wrong registration or lens, and for rho all of its play. A step that is
// proportional to the path is no moved endoscope.
const Eigen::Array3d of_path(0.1, 0.1, 0.5), of_path_suspected(0.5, 0.5, 0.5);
constexpr double unusual = 6, weight = 0.05;

// A gradual change is learnt so much later.
constexpr double learnt_after_s = 0.5;

// One joint's own is what the others show less of than this part of it, beside their path and what is usual.
constexpr double beside = 0.02, beside_of_path = 0.005, beside_usual = 2;

// By how much stamps are off, beyond four times what they usually are, up to the time between two images.
constexpr double min_late_s = 0.002, usual_lates = 4;
// By how much the delay is off at most, where it is a guess, and where it is known.
constexpr double guessed_delay_s = 0.15, known_delay_s = 0.02;

}  // namespace

bool OffsetSteps::add(const SeenOffset& offset, bool delay_is_known) {
  Seen now{offset};
  if (!seen_.empty()) now.path = seen_.back().path + (offset.measured - seen_.back().at.measured).cwiseAbs();
  while (!seen_.empty() && !(offset.stamp_s - seen_.front().at.stamp_s < memory_s)) seen_.pop_front();
  // A stamp that is missing or not newer carries no information.
  if (!seen_.empty() && !(offset.stamp_s > seen_.back().at.stamp_s)) return false;
  if (!latest_.empty() && !(offset.stamp_s > latest_.back().stamp_s)) latest_.clear();
  const bool usual_before = latest(false) != nullptr;
  const Seen *const last = latest(!usual_before), *const first = oldest(!usual_before);
  if (last) {
    const Changes changes{offset.stamp_s, change(*last, now, from_latest_, delay_is_known),
                          change(*first, now, from_oldest_, delay_is_known)};
    now.unusual = is_unusual(changes.from_latest, from_latest_) || is_unusual(changes.from_oldest, from_oldest_);
    if (!now.unusual) learn(changes, delay_is_known);
  }
  // It is there again, or rests elsewhere.
  if (!now.unusual) std::erase_if(seen_, [](const Seen& seen) { return seen.unusual; });
  seen_.push_back(now);
  return now.unusual;
}

// While the delay is a guess, what that makes of motion can't wait.
void OffsetSteps::learn(const Changes& changes, bool delay_is_known) {
  const auto learn_one = [](Usual& usual, const Change& seen) {
    usual.step_squared += weight * (seen.unexplained.square() - usual.step_squared);
    usual.late_s2 += weight * (seen.late_s * seen.late_s - usual.late_s2);
  };
  const auto learn_all = [&](const Changes& seen) {
    learn_one(from_latest_, seen.from_latest), learn_one(from_oldest_, seen.from_oldest);
  };
  if (!delay_is_known || is_of_one_joint(changes.from_oldest)) return learn_all(changes);
  latest_.push_back(changes);
  while (changes.stamp_s - latest_.front().stamp_s > learnt_after_s) {
    learn_all(latest_.front());
    latest_.pop_front();
  }
}

bool OffsetSteps::is_of_one_joint(const Change& change) const {
  const Eigen::Array3d expected = beside_usual * from_oldest_.step_squared.sqrt() + beside_of_path * change.path;
  const auto of_one = [&](const Eigen::Array3d& step) {
    Eigen::Index most = 0;
    const Eigen::Array3d size = step.abs() / min_step;
    const double allowed = beside * size.maxCoeff(&most);
    Eigen::Array3d others = (step.abs() - expected) / min_step;
    others[most] = 0;
    return others.maxCoeff() < allowed;
  };
  return of_one(change.unexplained) || of_one(change.seen);
}

const OffsetSteps::Seen* OffsetSteps::latest(bool unusual_ones) const {
  const auto found =
      std::find_if(seen_.rbegin(), seen_.rend(), [=](const Seen& seen) { return seen.unusual == unusual_ones; });
  return found == seen_.rend() ? nullptr : &*found;
}

const OffsetSteps::Seen* OffsetSteps::oldest(bool unusual_ones) const {
  const auto found =
      std::find_if(seen_.begin(), seen_.end(), [=](const Seen& seen) { return seen.unusual == unusual_ones; });
  return found == seen_.end() ? nullptr : &*found;
}

// A late image shows the joints at another time: all of them off along their motion; a wrong delay does the same where
// the motion changed. The best explanation by the two is subtracted, by turns, each within its bounds.
OffsetSteps::Change OffsetSteps::change(const Seen& before, const Seen& now, const Usual& usual,
                                        bool delay_is_known) const {
  const Eigen::Array3d step = (now.at.offset - before.at.offset).array() / min_step;
  const std::array<Eigen::Array3d, 2> per_s{now.at.rate_per_s.array() / min_step,
                                            (now.at.rate_per_s - before.at.rate_per_s).array() / min_step};
  const double apart_s = now.at.stamp_s - seen_.back().at.stamp_s;
  const std::array<double, 2> most_s{std::min(apart_s, min_late_s + usual_lates * std::sqrt(usual.late_s2)),
                                     delay_is_known ? known_delay_s : guessed_delay_s};
  std::array<double, 2> by_s{};
  Eigen::Array3d left = step;
  constexpr int turns = 4;
  for (int turn = 0; turn < turns; ++turn)
    for (std::size_t k = 0; k < by_s.size(); ++k) {
      const double square = per_s[k].square().sum();
      if (!(square > 0)) continue;
      const double wanted_s = by_s[k] + (per_s[k] * left).sum() / square;
      const double next_s = std::clamp(wanted_s, -most_s[k], most_s[k]);
      left -= (next_s - by_s[k]) * per_s[k];
      by_s[k] = next_s;
    }
  Eigen::Array3d path = (now.path - before.path).array();
  path.head<2>() = path.head<2>().maxCoeff();  // theta's and phi's, where the frame is off
  return {step * min_step, left * min_step, path, by_s[0]};
}

bool OffsetSteps::is_unusual(const Change& change, const Usual& usual) const {
  const Eigen::Array3d& share = seen_.back().unusual ? of_path_suspected : of_path;
  const Eigen::Array3d expected = unusual * usual.step_squared.sqrt() + share * change.path;
  return (change.unexplained.abs() > min_step + expected).any();
}

}  // namespace lapservo::internal
