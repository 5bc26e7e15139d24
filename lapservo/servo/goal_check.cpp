#include "lapservo/servo/goal_check.h"

#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "lapservo/control/trajectory_check.h"
#include "lapservo/core/error.h"
#include "lapservo/core/random.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/tip_goals.h"

namespace lapservo::internal {
namespace {

// The data that decide where the tip can go.
struct Reach {
  const TipGoals& tips;
  const FeatureModel& model;
  const ControllerConfig& config;

  std::optional<std::string> broken_at(const Eigen::Vector4d& q, const Eigen::Vector4d& feature_rate) const {
    const auto state = model ? model(q) : std::nullopt;
    if (!state) return "the camera does not see the marker then";
    return broken_limit(config, *state, q, feature_rate);
  }

  // Why a goal can't be reached, or passed while the features move so.
  std::optional<std::string> broken(const TipGoal& goal, const Eigen::Vector4d& feature_rate) const {
    if (!goal.position_m.allFinite()) return "its place is not finite";
    if (!(goal.position_m.z() > 0)) return "it lies behind the camera";
    const auto q = tips.configuration(goal);
    if (!q) return "no configuration holds the tip there: it lies too near to the RCM or to the camera";
    return broken_at(q->vector(), feature_rate);
  }

  // To three digits of a millimetre, by draws that come ever nearer to the best one so far.
  std::string nearest_text(const TipGoal& goal, const Eigen::Vector4d& q_start) const {
    if (!goal.position_m.allFinite()) return "";
    constexpr int draws = 4000;
    constexpr double last_spread = 1e-4;
    const JointLimits& limits = config.limits;
    const auto wanted = goal.position_m.z() > 0 ? tips.configuration(goal) : std::nullopt;
    if (wanted && !(wanted->psi_rad >= limits.lower[3] && wanted->psi_rad <= limits.upper[3]))
      return fmt::format("; rolls of {:.4g} to {:.4g} rad can be reached", limits.lower[3], limits.upper[3]);
    Random random(1);
    Eigen::Vector4d best = q_start;
    if (wanted) best[3] = wanted->psi_rad;
    double best_m = std::numeric_limits<double>::infinity();
    Eigen::Vector3d nearest_m = Eigen::Vector3d::Zero();
    for (int i = 0; i < draws; ++i) {
      const double spread = std::pow(last_spread, i / (draws - 1.0));
      Eigen::Vector4d q = i == 1 && wanted ? wanted->vector() : best;
      for (int k = 0; k < 3 && i > 1; ++k) q[k] += spread * random.normal() * (limits.upper[k] - limits.lower[k]) / 2;
      q = q.cwiseMax(limits.lower).cwiseMin(limits.upper);
      const auto tip_m = tips.tip_at(JointVector::from_vector(q));
      const double away_m = tip_m ? (*tip_m - goal.position_m).norm() : best_m;
      if (!(away_m < best_m) || !(tip_m->z() > 0) || broken_at(q, Eigen::Vector4d::Zero())) continue;
      best = q, best_m = away_m, nearest_m = *tip_m;
    }
    if (!std::isfinite(best_m)) return "; no place of the tip can be reached";
    return fmt::format("; the nearest that can be reached is {:.4f},{:.4f},{:.4f}, {:.1f} mm away", nearest_m.x(),
                       nearest_m.y(), nearest_m.z(), 1e3 * best_m);
  }
};

}  // namespace

void refuse_goal(const Trajectory& goal, double duration_s, const Rig& rig,
                 const std::optional<Rigid3>& camera_from_rcm, const ControllerConfig& config, const JointState& joints,
                 const std::string& source) {
  const FeatureModel model = feature_model(rig, camera_from_rcm);
  if (!goal.tip_at(0)) return refuse_infeasible(goal, duration_s, model, config, joints.q, source);
  constexpr double step_s = 0.02;
  TipGoals tips(rig, config.scales);
  tips.use(camera_from_rcm);
  tips.follow(joints);
  tips.refuse_incomplete(source, true);
  const Trajectory features = tips.features_of(goal);
  const Reach reach{tips, model, config};
  const auto steps = static_cast<long>(std::ceil(duration_s / step_s));
  for (long i = 0; i <= steps; ++i) {
    const double time_s = step_s * static_cast<double>(i);
    const auto wanted = goal.tip_at(time_s);
    if (!wanted)
      throw InputError(source, fmt::format("has no goal of the tip at {:.2f} s, expected one at any time", time_s));
    if (const auto why = reach.broken(*wanted, features.at(time_s).rate))
      throw InputError(source, Infeasible{time_s, *why}.text() + reach.nearest_text(*wanted, joints.q.vector()));
  }
}

}  // namespace lapservo::internal
