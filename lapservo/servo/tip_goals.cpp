#include "lapservo/servo/tip_goals.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/control/newton_inverse.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/error.h"
#include "lapservo/kinematics/tip_kinematics.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/tool/tool.h"
#include "lapservo/tool/wrist.h"

namespace lapservo::internal {
namespace {

constexpr double nearest_m = 0.01;         // before the camera
constexpr double step_s = 0.02;            // of differences by time
constexpr double correction_time_s = 0.3;  // of the mean over images
constexpr double wrist_time_s = 0.02;      // over which its readings count for how it moves
constexpr double largest_sigma_m = 3e-3;   // of the tip by its tool: that of a place that is registered
constexpr double wrist_rad_s = 6;          // a turn a second, which a hand hardly exceeds; WildReadings allow for more
constexpr double wrist_at_once_rad = 0.01;

Eigen::Vector4d difference(const JointVector& from, const JointVector& to) {
  Eigen::Vector4d step = to.vector() - from.vector();
  step[0] = wrap_pi(step[0]), step[3] = wrap_pi(step[3]);
  return step;
}

DesiredFeatures unknown() {
  DesiredFeatures desired;
  desired.features.setConstant(std::numeric_limits<double>::quiet_NaN());
  return desired;
}

}  // namespace

TipGoals::TipGoals(const Rig& rig, const Scales& scales)
    : rig_(rig),
      scales_(scales),
      wild_wrist_(Eigen::Vector4d::Constant(wrist_rad_s), Eigen::Vector4d::Constant(wrist_at_once_rad)),
      last_(unknown()) {
  use(rig.instruments.at(0).camera_from_rcm);
}

void TipGoals::refuse_incomplete(const std::string& source, bool has_joints) const {
  const auto& tool = rig_.instruments[0].tool;
  const auto refuse = [&](const std::string& what) {
    throw InputError(source, "is a goal of the tip, which needs " + what);
  };
  if (!rig_.instruments[0].camera_from_rcm) refuse("the rig's camera_from_rcm and a method other than uncalibrated");
  if (!tool || !tool->place) refuse("the rig's `tool` with its place");
  if (!has_joints) return;
  if (wrist_.size() != tool->wrist.size())
    refuse(fmt::format("the wrist's joints, but the arm does not measure {}", fmt::join(wrist_names(tool), ", ")));
  if (const double sigma_m = tip_sigma_m(0); sigma_m > largest_sigma_m)
    refuse(fmt::format(
        "a tip that is known to {:.0f} mm in the marker's frame, but by the rig's `tool`, bent as it is, it "
        "is known to {:.2g} mm: lapservo calibrate tip --touch with a bent wrist measures it",
        1e3 * largest_sigma_m, 1e3 * sigma_m));
}

void TipGoals::use(const std::optional<Rigid3>& camera_from_rcm) {
  if (camera_from_rcm_ == camera_from_rcm && model_) return;
  camera_from_rcm_ = camera_from_rcm;
  model_ = feature_model(rig_, camera_from_rcm);
}

void TipGoals::follow(const JointState& joints) {
  const Eigen::Vector4d q = joints.q.vector();
  if (!q.allFinite()) return;
  q_ = q;
  if (joints.started) psi_by_ = PsiBy::joints;  // while it was held, others may have rolled it
  if (psi_by_ == PsiBy::joints) psi_rad_ = q[3];
  follow_wrist(joints.wrist_rad, joints.time_s);
}

// A parabola through the readings, of which those of long ago count exponentially less: without lag where the wrist
// accelerates evenly (fading memory filter of second order).
void TipGoals::follow_wrist(const std::vector<double>& now_rad, double time_s) {
  constexpr double silence_s = 0.2;
  if (!std::isfinite(time_s)) return;
  const double passed_s = time_s - wrist_s_;
  if (!(passed_s > 0)) return;
  wrist_s_ = time_s;
  const auto& tool = rig_.instruments[0].tool;
  const std::size_t size = tool ? tool->wrist.size() : 0;
  const bool read = now_rad.size() == size &&
                    std::all_of(now_rad.begin(), now_rad.end(), [](double angle) { return std::isfinite(angle); });
  Eigen::Vector4d now = Eigen::Vector4d::Zero();
  static_assert(Tool::max_wrist_joints == decltype(now)::SizeAtCompileTime);
  if (read) std::copy(now_rad.begin(), now_rad.end(), now.begin());
  using Verdict = decltype(wild_wrist_)::Verdict;
  const Verdict verdict = read ? wild_wrist_.validate(time_s, now) : Verdict::wild;
  if (verdict != Verdict::plausible) wrist_.clear(), past_wrist_.clear();
  if (verdict == Verdict::wild) return;
  past_wrist_.push(time_s, now);
  if (wrist_.size() != size || passed_s > silence_s) {
    wrist_.clear();
    for (const double angle_rad : now_rad) wrist_.push_back({angle_rad, angle_rad});
    return;
  }
  const double fading = std::exp(-passed_s / wrist_time_s), fresh = 1 - fading;
  for (std::size_t i = 0; i < wrist_.size(); ++i) {
    WristMotion& motion = wrist_[i];
    const double off_rad =
        now_rad[i] - motion.smooth_rad - passed_s * motion.rad_s - passed_s * passed_s / 2 * motion.rad_s2;
    motion.rad = now_rad[i];
    motion.smooth_rad = now_rad[i] - fading * fading * fading * off_rad;
    motion.rad_s += passed_s * motion.rad_s2 + 1.5 * fresh * fresh * (1 + fading) / passed_s * off_rad;
    motion.rad_s2 += fresh * fresh * fresh / (passed_s * passed_s) * off_rad;
  }
}

std::optional<std::vector<double>> TipGoals::wrist_rad(double ahead_s) const {
  const auto& tool = rig_.instruments[0].tool;
  if (!tool || wrist_.size() != tool->wrist.size()) return std::nullopt;
  std::vector<double> wrist_rad;
  for (const WristMotion& joint : wrist_)
    wrist_rad.push_back(joint.rad + ahead_s * joint.rad_s + ahead_s * ahead_s / 2 * joint.rad_s2);
  return wrist_rad;
}

std::optional<std::vector<double>> TipGoals::past_wrist_rad(double ago_s) const {
  const auto& tool = rig_.instruments[0].tool;
  if (!tool || past_wrist_.size() == 0) return wrist_rad(0);
  const Eigen::Vector4d then = past_wrist_.at(std::max(past_wrist_.oldest_s(), wrist_s_ - ago_s)).value();
  return std::vector<double>(then.begin(), then.begin() + std::ssize(tool->wrist));
}

std::optional<Rigid3> TipGoals::marker_from_tip(const std::optional<std::vector<double>>& wrist_rad) const {
  const auto& tool = rig_.instruments[0].tool;
  return wrist_rad && tool->place ? std::optional(tip_in_marker(*tool, *wrist_rad).marker_from_tip) : std::nullopt;
}

double TipGoals::tip_sigma_m(double ahead_s) const {
  const auto wrist = wrist_rad(ahead_s);
  const auto& tool = rig_.instruments[0].tool;
  if (!wrist || !tool->place) return std::numeric_limits<double>::infinity();
  return std::sqrt(eigenvalues_of_symmetric(tip_in_marker(*tool, *wrist).covariance_m2)[2]);
}

void TipGoals::see(const ImageMeasurement& image, const Rigid3& camera_from_rcm) {
  const auto tip = marker_from_tip(wrist_rad(0));
  if (!tip || !image.found || !image.camera_from_marker) return;
  const auto shown =
      newton_inverse(feature_model(rig_, camera_from_rcm), image.features, image.q.value_or(q_), scales_);
  if (!shown || !shown->converged) return;
  if (psi_by_ != PsiBy::goal) {
    psi_rad_ = q_[3] + wrap_pi(shown->q[3] - q_[3]);
    psi_by_ = tip_wanted_ ? PsiBy::goal : PsiBy::image;
  }
  const Rigid3 camera_from_marker =
      lapservo::camera_from_marker(rig_.instruments[0].marker, camera_from_rcm, JointVector::from_vector(shown->q));
  const Eigen::Vector3d seen_m = *image.camera_from_marker * tip->translation,
                        there_m = camera_from_marker * tip->translation;
  if (!(std::min(seen_m.z(), there_m.z()) > nearest_m)) return;
  const Eigen::Vector2d off_px = rig_.camera.ideal_from_point(seen_m) - rig_.camera.ideal_from_point(there_m);
  if (image.registration != registration_) corrected_s_.reset();
  const double kept = corrected_s_ ? std::exp(-std::max(0.0, image.time_s - *corrected_s_) / correction_time_s) : 0;
  off_px_ = kept * off_px_ + (1 - kept) * off_px;
  corrected_s_ = image.time_s;
  registration_ = image.registration;
}

std::optional<JointVector> TipGoals::configuration(const TipGoal& goal, double ahead_s) const {
  const auto tip = marker_from_tip(wrist_rad(ahead_s));
  const double depth_m = goal.position_m.z();
  if (!tip || !camera_from_rcm_ || !(depth_m > nearest_m) || tip_sigma_m(ahead_s) > largest_sigma_m)
    return std::nullopt;
  const Camera& camera = rig_.camera;
  const Marker& marker = rig_.instruments[0].marker;
  const Eigen::Vector3d place_m = depth_m * camera.ray_from_ideal(camera.ideal_from_point(goal.position_m) - off_px_);
  auto q = goal.camera_from_tip ? configuration_of_tip(*camera_from_rcm_, marker, *tip, place_m, *goal.camera_from_tip)
                                : configuration_of_tip(*camera_from_rcm_, marker, tip->translation, place_m,
                                                       goal.roll_rad.value_or(psi_rad_));
  if (!q) return std::nullopt;
  q->theta_rad = q_[0] + wrap_pi(q->theta_rad - q_[0]);
  q->psi_rad = psi_rad_ + wrap_pi(q->psi_rad - psi_rad_);
  return q;
}

std::optional<Eigen::Vector3d> TipGoals::tip_at(const JointVector& q) const {
  const auto tip = marker_from_tip(wrist_rad(0));
  if (!tip || !camera_from_rcm_) return std::nullopt;
  return lapservo::camera_from_marker(rig_.instruments[0].marker, *camera_from_rcm_, q) * tip->translation;
}

std::optional<Eigen::Vector2d> TipGoals::error_px(const ImageMeasurement& image, const TipGoal& goal,
                                                  double ago_s) const {
  const auto tip = marker_from_tip(past_wrist_rad(ago_s));
  if (!tip || !image.camera_from_marker) return std::nullopt;
  const Eigen::Vector3d seen_m = *image.camera_from_marker * tip->translation;
  if (!(std::min(seen_m.z(), goal.position_m.z()) > nearest_m)) return std::nullopt;
  return rig_.camera.ideal_from_point(seen_m) - rig_.camera.ideal_from_point(goal.position_m);
}

std::optional<DesiredFeatures> TipGoals::desired(const Trajectory& goal, double time_s) const {
  const auto at = [&](double ahead_s) -> std::optional<JointVector> {
    const auto wanted = goal.tip_at(time_s + ahead_s);
    return wanted ? configuration(*wanted, ahead_s) : std::nullopt;
  };
  const auto now = at(0), before = at(-step_s), after = at(step_s);
  const auto state = now && model_ ? model_(now->vector()) : std::nullopt;
  if (!state) return std::nullopt;
  DesiredFeatures desired;
  desired.features = state->features;
  const auto earlier = before ? model_(before->vector()) : std::nullopt,
             later = after ? model_(after->vector()) : std::nullopt;
  if (!earlier || !later) return desired;
  const Eigen::Vector4d back = difference(*before, *now), on = difference(*now, *after);
  const Eigen::Vector4d rate = (on + back) / (2 * step_s), acceleration = (on - back) / (step_s * step_s);
  desired.rate = state->jacobian * rate;
  desired.acceleration = state->jacobian * acceleration + (later->jacobian - earlier->jacobian) * rate / (2 * step_s);
  return desired;
}

Trajectory TipGoals::features_of(const Trajectory& goal) {
  return {goal.duration_s,
          [this, goal](double time_s) {
            const auto wanted = goal.tip_at(time_s);
            tip_wanted_ = wanted.has_value();
            const bool turned = std::exchange(roll_wanted_, wanted && (wanted->roll_rad || wanted->camera_from_tip));
            const bool released = !wanted || (turned && !roll_wanted_);  // by a goal that leaves the roll as it is
            if (released && psi_by_ == PsiBy::goal) psi_by_ = PsiBy::image;
            if (!wanted) return last_ = goal.at(time_s);
            if (!marker_from_tip(wrist_rad(0))) return unknown();
            if (const auto now = desired(goal, time_s)) {
              last_ = *now;
              if (roll_wanted_) psi_rad_ = configuration(*wanted)->psi_rad, psi_by_ = PsiBy::goal;
              return last_;
            }
            last_.rate.setZero(), last_.acceleration.setZero();
            DesiredFeatures resting = last_;
            if (camera_from_rcm_)
              resting.hold = tip_sigma_m(0) > largest_sigma_m ? HoldReason::tip_open : HoldReason::tip_unreachable;
            return resting;
          },
          goal.tip};
}

}  // namespace lapservo::internal
