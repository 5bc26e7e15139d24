#include "lapservo/servo/run_summary.h"

#include <cmath>
#include <limits>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "lapservo/control/tracking_law.h"
#include "lapservo/core/angles.h"
#include "lapservo/rig/registration_covariance.h"

namespace lapservo::internal {
namespace {

std::string reason_text(const ServoDecision& decision) {
  const std::string& remedy = decision.remedy;
  return std::string(to_string(decision.control.reason)) + (remedy.empty() ? "" : fmt::format(" ({})", remedy));
}

}  // namespace

std::string state_text(const ServoDecision& decision) {
  const std::string action(to_string(decision.control.action));
  return decision.control.reason == HoldReason::none ? action : action + ": " + reason_text(decision);
}

std::string block_of(const Supervisor& arm) {
  return arm.armed() ? "" : std::string(to_string(arm.blocked()));
}

std::string state_text(const ServoDecision& decision, const Supervisor& arm) {
  // Whatever else holds the arm meanwhile, this is the operator's part.
  return arm.armed() || !decision.remedy.empty() ? state_text(decision) : arm.text();
}

void RunSummary::follow_registration(const ControlTick& tick) {
  const auto& now = tick.decision.camera_from_rcm;
  if (camera_from_rcm_ && !now && !moved_s_) {
    moved_s_ = tick.input.time_s;
    convergence_ = {};
  }
  if (moved_s_ && now) {
    const Rigid3 before_from_now = *camera_from_rcm_ * now->inverse();
    endoscope_motions_.push_back(fmt::format(
        "the endoscope moved by {:.1f} mm and {:.1f} degrees (noticed at {:.2f} s): started with camera_from_rcm "
        "measured anew {:.1f} s later",
        1e3 * before_from_now.translation.norm(), deg_from_rad(Eigen::AngleAxisd(before_from_now.rotation).angle()),
        *moved_s_ - start_s_.value_or(*moved_s_), tick.input.time_s - *moved_s_));
    moved_s_.reset();
  }
  if (now) camera_from_rcm_ = now;
}

void RunSummary::add(const ControlTick& tick, const std::optional<InstrumentTruth>& truth, const std::string& block) {
  const ControlStep& control = tick.decision.control;
  if (!start_s_) start_s_ = tick.input.time_s;
  ++ticks_;
  follow_registration(tick);
  contradicted_ += tick.decision.registration_contradicted;
  const bool holds = control.action == ControlAction::hold;
  const bool blocked = control.reason == HoldReason::arm_not_enabled && !block.empty();
  if (holds) ++held_[blocked ? block : std::string(to_string(control.reason))];
  held_at_end_ = holds ? std::optional(blocked ? block : reason_text(tick.decision)) : std::nullopt;
  Eigen::Vector4d error = control.error;
  const bool by_truth = truth && !tick.pursues_tip;
  by_estimate_ = !(by_truth && truth->features);
  if (!by_estimate_) {
    error = feature_error(*truth->features, tick.input.desired.features);
  } else if (!by_truth && !(control.estimate && tick.input.desired.features.allFinite())) {
    if (converged()) return;
    error.setConstant(std::numeric_limits<double>::infinity());  // not known, and so not small
  }
  convergence_.add(tick.input.time_s - *start_s_, error, holds, tick.tip_error_px);
}

std::string RunSummary::convergence_text() const {
  const auto reached_s = convergence_.reached_s();
  const std::string by = by_estimate_ ? ", by the loop's own estimate" : "";
  if (!reached_s) {
    const auto first_s = convergence_.first_s();
    return (first_s
                ? fmt::format("not within 1 px and 5 mrad for the last second, though from {:.2f} s on for a second",
                              *first_s)
                : "not within 1 px and 5 mrad for a second") +
           by;
  }
  const Eigen::Vector4d rms = convergence_.rms_since();
  const long held = convergence_.held_since();
  const auto tip_px = convergence_.tip_rms_px();
  return fmt::format(
      "within 1 px and 5 mrad from {:.2f} s on; rms since{}: s {:.2f} mrad, r {:.2f}, l {:.2f}, d {:.2f} px{}{}",
      *reached_s, held > 0 ? fmt::format(" while it tracked (held for {} ticks)", held) : "", 1000 * rms[0], rms[1],
      rms[2], rms[3], by, tip_px ? fmt::format("; the seen tip {:.2f} px from its goal", *tip_px) : "");
}

std::string RunSummary::holds_text() const {
  std::string text;
  for (const auto& [reason, count] : held_) text += fmt::format("\nheld for {} of {} ticks: {}", count, ticks_, reason);
  for (const std::string& motion : endoscope_motions_) text += "\n" + motion;
  if (held_at_end_) text += "\nended in a hold: " + *held_at_end_;
  if (contradicted_ > 0)
    text += fmt::format(
        "\nregistration_contradicted in {} of {} ticks: {}, since camera_from_rcm or the lens is wrong, and r is off "
        "by that: {}",
        contradicted_, ticks_, misses_rcm_text, measure_registration_text);
  return text;
}

}  // namespace lapservo::internal
