#include "lapservo/control/random_start.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "lapservo/control/newton_inverse.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/control/trajectory_check.h"
#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {

bool in_view(const FeatureModel& model, const ImageWindow& window, const Eigen::Vector4d& q) {
  const auto state = model(q);
  if (!state) return false;
  const Eigen::Vector4d& e = state->ends_px;
  constexpr double shortest_px = 60;
  return std::min(e[0], e[2]) > window.u_min_px && std::max(e[0], e[2]) < window.u_max_px &&
         std::min(e[1], e[3]) > window.v_min_px && std::max(e[1], e[3]) < window.v_max_px &&
         state->features[2] > shortest_px;
}

// d jumps where the marker's seam passes the centre line: image features can't lead across it.
bool seam_lies_between(const FeatureModel& model, const Eigen::Vector4d& from, const Eigen::Vector4d& to) {
  constexpr int steps = 100;
  constexpr double jump = 0.08;  // of l
  auto here = model(from);
  for (int i = 1; i <= steps; ++i) {
    const auto next = model(from + (to - from) * i / steps);
    if (!here || !next || std::abs(next->features[3] - here->features[3]) > jump * here->features[2]) return true;
    here = next;
  }
  return false;
}

// Where eq. (22) leads: each error decays with its own K. The rates stay empty, since limits only slow the way down.
Trajectory decay_to(const Trajectory& goal, const Eigen::Vector4d& from, const TrackingGains& gains) {
  const Eigen::Vector4d error = feature_error(from, goal.at(0).features);
  return {goal.duration_s, [=](double time_s) {
            const Eigen::Array4d left = (-time_s * gains.per_s.array()).exp();
            return DesiredFeatures{goal.at(time_s).features + (left * error.array()).matrix()};
          }};
}

// The reason why the arm can't follow from here; also on the paper's law's own way, where the law sees and moves the
// true instrument.
std::optional<Infeasible> find_problem(const Trajectory& trajectory, double duration_s, const FeatureModel& model,
                                       const ControllerConfig& config, const Eigen::Vector4d& q,
                                       const Eigen::Vector4d& q_true) {
  constexpr double check_every_s = 0.1;
  if (auto problem = find_infeasible(trajectory, duration_s, model, config, q, check_every_s)) return problem;
  if (config.mode != ControlMode::paper) return std::nullopt;
  const Trajectory way = decay_to(trajectory, model(q_true)->features, config.gains);
  return find_infeasible(way, duration_s, model, config, q_true, check_every_s);
}

}  // namespace

JointVector random_start(const Trajectory& trajectory, double duration_s, const FeatureModel& model,
                         const ControllerConfig& config, const Eigen::Vector4d& joint_offset, Random& random,
                         const std::string& source) {
  constexpr int max_places = 100000, max_starts = 60;
  std::map<std::string, std::pair<int, std::string>> problems;  // by kind: of how many starts, the first one's text
  const auto add = [&](const std::string& kind, const std::string& text) {
    auto& [count, first] = problems[kind];
    if (count++ == 0) first = text;
  };
  int starts = 0;
  for (int i = 0; i < max_places && starts < max_starts; ++i) {
    Eigen::Vector4d q;
    for (int k = 0; k < 4; ++k) q[k] = random.uniform(config.limits.lower[k], config.limits.upper[k]);
    if (!in_view(model, config.window.value(), q + joint_offset)) continue;
    ++starts;
    if (const auto problem = find_problem(trajectory, duration_s, model, config, q, q + joint_offset)) {
      add(problem->what.substr(0, problem->what.find(": needs")), problem->text());
      continue;
    }
    const auto goal = newton_inverse(model, trajectory.at(0).features, q, config.scales);
    if (goal && goal->converged && !seam_lies_between(model, q, goal->q)) return JointVector::from_vector(q);
    constexpr auto seam = "the marker's seam lies between the start and the trajectory";
    add(seam, seam);
  }
  const auto usual = std::max_element(problems.begin(), problems.end(),
                                      [](const auto& a, const auto& b) { return a.second.first < b.second.first; });
  throw InputError(source, starts == 0 ? "no place in view lies within the joint limits" : usual->second.second);
}

}  // namespace lapservo::internal
