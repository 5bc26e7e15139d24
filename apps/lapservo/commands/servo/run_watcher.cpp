#include "apps/lapservo/commands/servo/run_watcher.h"

#include <cstdio>
#include <utility>

#include "apps/lapservo/cli/interrupt.h"
#include "lapservo/core/error.h"

namespace lapservo::app {
using namespace internal;

bool RunWatcher::on_tick(const ControlTick& tick) {
  if (!start_s_) start_s_ = tick.input.time_s;
  duration_s_ = tick.input.time_s - *start_s_;
  const std::optional<InstrumentTruth> true_now = truth();
  summary_.add(tick, true_now, arm_ ? block_of(*arm_) : "");
  if (folder_) folder_->add(tick, true_now);
  const std::string before = std::exchange(state_, arm_ ? state_text(tick.decision, *arm_) : state_text(tick.decision));
  is_new_state_ = state_ != before;
  if (!follow(tick, duration_s_)) return false;
  if (page_ && ends_by_page(tick, duration_s_)) return false;
  if (options_.strict && summary_.registration_contradicted()) return false;
  return !interrupted();
}

bool RunWatcher::ends_by_page(const ControlTick& tick, double time_s) {
  page_->tell(tick, time_s, state_, arm_->can_start());
  const bool ends = page_->command(*arm_, tick.input.time_s);
  if (ends) say(time_s, "end: requested on the page");
  return ends;
}

void RunWatcher::follow_goal(ChangingGoal& goal, const ControlTick& tick, double time_s) {
  std::optional<std::string> said;
  try {
    if (const auto wanted = page_ ? page_->tip_goal() : std::nullopt)
      goal.want("tip_goal", 0, tip_set_point(*wanted, "tip_goal"));
    said = goal.follow(tick);
  } catch (const InputError& error) {
    said = std::string("refused: ") + error.what();
  }
  if (!said) return;
  say(time_s, *said);
  if (page_) page_->answer(time_s, *said);
}

bool RunWatcher::commit_log() {
  if (!folder_) return true;
  if (!folder_->commit()) return false;
  std::printf("log, rig and controller: %s\n", options_.out.c_str());
  return true;
}

}  // namespace lapservo::app
