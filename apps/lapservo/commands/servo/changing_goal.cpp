#include "apps/lapservo/commands/servo/changing_goal.h"

#include <chrono>
#include <utility>

#include "lapservo/core/error.h"
#include "lapservo/servo/goal_check.h"

namespace lapservo::app {
using namespace internal;

ChangingGoal::ChangingGoal(Trajectory first, const RunConfig& run)
    : run_(run), now_(std::make_shared<Trajectory>(std::move(first))) {}

Trajectory ChangingGoal::trajectory() const {
  return {0, [current = now_](double time_s) { return current->at(time_s); },
          [current = now_](double time_s) { return current->tip_at(time_s); }};
}

void ChangingGoal::want(const std::string& name, double duration_s, Trajectory trajectory) {
  wanted_ = Wanted{name, duration_s, std::move(trajectory)};
}

std::optional<std::string> ChangingGoal::follow(const ControlTick& tick) {
  auto said = result(tick);
  check_next(tick);
  return said;
}

std::optional<std::string> ChangingGoal::result(const ControlTick& tick) {
  if (!refusal_.valid() || refusal_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return std::nullopt;
  const std::string refusal = refusal_.get();
  if (asked_.registration != tick.decision.registration) {
    if (!wanted_) wanted_ = asked_;  // it was checked for an earlier place of the endoscope
    return std::nullopt;
  }
  if (!refusal.empty()) return "refused: " + refusal;
  const double from_s = tick.trajectory_s;
  *now_ = {0, [at = asked_.trajectory.at, from_s](double now_s) { return at(now_s - from_s); },
           [asked = asked_.trajectory, from_s](double now_s) { return asked.tip_at(now_s - from_s); }};
  const std::string& name = asked_.name;
  return std::string("a ") +
         (name == "tip_goal"    ? "goal of the tip"
          : name == "set_point" ? "setpoint"
                                : "trajectory") +
         " came";
}

void ChangingGoal::check_next(const ControlTick& tick) {
  const ServoDecision& decision = tick.decision;
  const bool being_measured = run_.rig.instruments.front().camera_from_rcm && !decision.camera_from_rcm;
  if (!wanted_ || refusal_.valid() || being_measured) return;
  const auto first_from_camera = run_.endoscope ? run_.endoscope->first_from_camera(tick.input.time_s) : Rigid3();
  if (!first_from_camera) return;
  std::optional<Rigid3> camera_from_rcm = decision.camera_from_rcm;
  if (camera_from_rcm) camera_from_rcm = first_from_camera->inverse() * *camera_from_rcm;
  asked_ = *std::exchange(wanted_, std::nullopt);
  asked_.registration = decision.registration;
  // A long trajectory takes longer to walk along than a tick has.
  refusal_ = std::async(std::launch::async,
                        [this, wanted = asked_, joints = tick.input.joints, camera_from_rcm]() -> std::string {
                          try {
                            refuse_goal(wanted.trajectory, wanted.duration_s, run_.rig, camera_from_rcm,
                                        controller_of(run_), joints, wanted.name);
                          } catch (const InputError& error) {
                            return error.what();
                          }
                          return {};
                        });
}

}  // namespace lapservo::app
