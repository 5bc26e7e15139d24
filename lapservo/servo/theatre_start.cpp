#include "lapservo/servo/theatre_start.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "lapservo/control/newton_inverse.h"
#include "lapservo/control/trajectory_check.h"
#include "lapservo/core/error.h"
#include "lapservo/servo/image_features.h"

namespace lapservo {
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
            const Eigen::Vector4d features = goal.at(time_s).features + (left * error.array()).matrix();
            return DesiredFeatures{features, Eigen::Vector4d::Zero(), Eigen::Vector4d::Zero()};
          }};
}

// The truth is what the law sees and what it moves.
std::optional<Infeasible> problem_on_the_papers_way(const Trajectory& goal, double duration_s,
                                                    const FeatureModel& model, const ControllerConfig& controller,
                                                    const Eigen::Vector4d& q_true) {
  constexpr double check_every_s = 0.1;
  const Trajectory way = decay_to(goal, model(q_true)->features, controller.gains);
  return find_infeasible(way, duration_s, model, controller, q_true, check_every_s);
}

Eigen::Vector4d anywhere(const JointLimits& limits, Random& random) {
  Eigen::Vector4d q;
  for (int i = 0; i < 4; ++i) q[i] = random.uniform(limits.lower[i], limits.upper[i]);
  return q;
}

}  // namespace

void refuse_infeasible(const Trajectory& trajectory, double duration_s, const Rig& rig,
                       const ControllerConfig& controller, const RcmCoordinates& readings, const std::string& source) {
  const FeatureModel model = feature_model(rig);
  if (!model) return;
  if (const auto problem = find_infeasible(trajectory, duration_s, model, controller, readings.vector()))
    throw InputError(source, fmt::format("can't be followed at {:.2f} s: {}", problem->time_s, problem->what));
}

RcmCoordinates random_start(const Trajectory& trajectory, double duration_s, const Rig& rig,
                            const ControllerConfig& controller, const ArmConfig& arm, Random& random,
                            const std::string& source) {
  constexpr int most_places = 100000, most_starts = 60;
  constexpr double check_every_s = 0.1;
  const FeatureModel model = feature_model(rig);
  if (!model) throw InputError("rig", "instruments[0].camera_from_rcm is missing, expected it for a random start");
  std::string why = "no place in view lies within the joint limits";
  int starts = 0;
  for (int i = 0; i < most_places && starts < most_starts; ++i) {
    const Eigen::Vector4d readings = anywhere(controller.limits, random);
    if (!in_view(model, controller.window.value(), readings + arm.joint_offset)) continue;
    ++starts;
    auto problem = find_infeasible(trajectory, duration_s, model, controller, readings, check_every_s);
    if (!problem && controller.mode == ControlMode::paper)
      problem = problem_on_the_papers_way(trajectory, duration_s, model, controller, readings + arm.joint_offset);
    if (!problem) {
      const auto goal = newton_inverse(model, trajectory.at(0).features, readings, controller.scales);
      if (goal && goal->converged && !seam_lies_between(model, readings, goal->q))
        return RcmCoordinates::from_vector(readings);
      why = "the marker's seam lies between every start and the trajectory";
      continue;
    }
    why = fmt::format("can't be followed at {:.2f} s: {}", problem->time_s, problem->what);
  }
  throw InputError(source, why);
}

}  // namespace lapservo
