#include "lapservo/servo/goal_check.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "lapservo/control/trajectory_check.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/error.h"
#include "lapservo/core/random.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/tip_goals.h"

namespace lapservo::internal {
namespace {

// The data that decide where the tip can go.
struct Reach {
  const TipGoals& tips;
  const FeatureModel& model;
  const ControllerConfig& config;
  const Rig& rig;
  const std::optional<Rigid3>& camera_from_rcm;
  JointVector before;  ///< at the start the joints, then of the step before
  bool is_on_its_way = false;

  std::optional<CentreLine> line_at(const JointVector& q) const {
    return centre_line(rig.camera, rig.instruments[0].marker, *camera_from_rcm * rcm_from_unrolled(q), q.psi_rad);
  }

  // The turn to which the features lead from the step before, out of those that hold the tip alike: d jumps where the
  // marker's seam passes the centre line, so the shaft turns the way on which it does not, be it the longer one.
  std::optional<JointVector> configuration(const TipGoal& goal) const {
    auto q = tips.configuration(goal);
    const auto here = q ? line_at(before) : std::nullopt, there = q ? line_at(*q) : std::nullopt;
    if (!here || !there) return q;
    const double turn_rad =
        wrap_pi(there->facing_azimuth_rad - here->facing_azimuth_rad) - there->tau_rad + here->tau_rad;
    q->psi_rad += two_pi * std::round((before.psi_rad + turn_rad - q->psi_rad) / two_pi);
    return q;
  }

  bool passes_seam(const JointVector& q) const { return is_on_its_way && std::abs(q.psi_rad - before.psi_rad) > pi; }

  std::optional<std::string> broken_at(const Eigen::Vector4d& q, const Eigen::Vector4d& feature_rate) const {
    const auto state = model ? model(q) : std::nullopt;
    if (!state) return "the camera does not see the marker then";
    return broken_limit(config, *state, q, feature_rate);
  }

  // Why a goal can't be reached, or passed while the features move so.
  std::optional<std::string> broken(const TipGoal& goal, const Eigen::Vector4d& feature_rate) const {
    if (!goal.position_m.allFinite()) return "its place is not finite";
    if (!(goal.position_m.z() > 0)) return "it lies behind the camera";
    const auto q = configuration(goal);
    if (!q) return "no configuration holds the tip there: it lies too near to the RCM or to the camera";
    if (passes_seam(*q)) return "the marker's seam faces the camera there, where the features jump";
    return broken_at(q->vector(), feature_rate);
  }

  // A goal that is typed as this text has it is not refused. By draws that come ever nearer to the best one so far.
  std::string nearest_text(const TipGoal& goal, const Eigen::Vector4d& q_start) const {
    if (!goal.position_m.allFinite()) return "";
    constexpr int draws = 4000;
    constexpr double last_spread = 1e-3, per_m = 1e4, per_rad = 1e3;  // as many steps as the text's digits show
    const JointLimits& limits = config.limits;
    const auto wanted = goal.position_m.z() > 0 ? configuration(goal) : std::nullopt;
    const auto line = wanted ? line_at(*wanted) : std::nullopt;
    const bool too_far = wanted && !(wanted->psi_rad >= limits.lower[3] && wanted->psi_rad <= limits.upper[3]);
    if (line && (too_far || passes_seam(*wanted))) {
      const double seam_rad = wanted->psi_rad + line->tau_rad;
      return fmt::format("; rolls of {:.4g} to {:.4g} rad can be reached without the marker's seam facing the camera",
                         std::ceil(per_rad * std::max(limits.lower[3], seam_rad - two_pi)) / per_rad,
                         std::floor(per_rad * std::min(limits.upper[3], seam_rad)) / per_rad);
    }
    Random random(1);
    Eigen::Vector4d best = q_start;
    if (wanted) best[3] = wanted->psi_rad;
    double best_m = std::numeric_limits<double>::infinity();
    TipGoal nearest = goal;
    for (int i = 0; i < draws; ++i) {
      const double spread = std::pow(last_spread, i / (draws - 1.0));
      Eigen::Vector4d q = i == 1 && wanted ? wanted->vector() : best;
      for (int k = 0; k < 3 && i > 1; ++k) q[k] += spread * random.normal() * (limits.upper[k] - limits.lower[k]) / 2;
      q = q.cwiseMax(limits.lower).cwiseMin(limits.upper);
      const auto tip_m = tips.tip_at(JointVector::from_vector(q));
      if (!tip_m) continue;
      TipGoal shown = goal;
      shown.position_m = (per_m * *tip_m).array().round() / per_m;
      const double away_m = (shown.position_m - goal.position_m).norm();
      if (!(away_m < best_m) || broken(shown, Eigen::Vector4d::Zero())) continue;
      best = q, best_m = away_m, nearest = shown;
    }
    if (!std::isfinite(best_m)) return "; no place of the tip can be reached";
    const Eigen::Vector3d& place_m = nearest.position_m;
    return fmt::format("; the nearest that can be reached is {:.4f},{:.4f},{:.4f}{}, {:.1f} mm away", place_m.x(),
                       place_m.y(), place_m.z(), goal.roll_rad ? fmt::format(",{}", *goal.roll_rad) : "", 1e3 * best_m);
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
  Reach reach{tips, model, config, rig, camera_from_rcm, joints.q};
  const auto steps = static_cast<long>(std::ceil(duration_s / step_s));
  for (long i = 0; i <= steps; ++i) {
    const double time_s = step_s * static_cast<double>(i);
    const auto wanted = goal.tip_at(time_s);
    if (!wanted)
      throw InputError(source, fmt::format("has no goal of the tip at {:.2f} s, expected one at any time", time_s));
    if (const auto why = reach.broken(*wanted, features.at(time_s).rate))
      throw InputError(source, Infeasible{time_s, *why}.text() + reach.nearest_text(*wanted, joints.q.vector()));
    reach.before = reach.configuration(*wanted).value();
    reach.is_on_its_way = true;
  }
}

}  // namespace lapservo::internal
