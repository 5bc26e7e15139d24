#include "apps/lapservo/commands/servo/run_watcher.h"

#include <cstdint>
#include <cstdio>
#include <utility>

#include "apps/lapservo/cli/interrupt.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/rig/rig_writer.h"
#include "lapservo/servo/controller_file.h"

namespace lapservo::app {
using namespace internal;
namespace {

std::uintmax_t needed_bytes(double duration_s, const ControllerConfig& controller) {
  constexpr std::uintmax_t bytes_a_tick = 4000;
  return bytes_a_tick * static_cast<std::uintmax_t>(duration_s / controller.period_s) + (1 << 20);
}

InputFiles inputs_of(const ServoOptions& options, const Rig& rig) {
  InputFiles inputs;
  inputs.add_rig(options.rig, rig);
  inputs.add(options.controller);
  inputs.add(options.trajectory);
  inputs.add(options.joint_limits);
  inputs.add_recording(options.recorded.input);
  return inputs;
}

}  // namespace

void say(double time_s, const std::string& what) {
  std::printf("%.2f s  %s\n", time_s, what.c_str());
  std::fflush(stdout);
}

RunFolder::RunFolder(const ServoOptions& options, double duration_s, const Rig& rig, const ControllerConfig& controller,
                     const Rig* truth)
    : path_(options.out) {
  if (path_.empty()) return;
  folder_.emplace(path_, rig, inputs_of(options, rig), options.force, needed_bytes(duration_s, controller));
  log_.emplace(*folder_ / "log.csv");
  write_file(*folder_ / "controller.yaml", controller_yaml(controller));
  if (truth && rig_yaml(*truth) != rig_yaml(rig)) write_file(*folder_ / "true_rig.yaml", rig_yaml(*truth));
}

void RunFolder::add(const ControlTick& tick, const std::optional<InstrumentTruth>& truth) {
  if (!log_ || failed_) return;
  try {
    log_->add(tick.input, tick.decision, truth);
  } catch (const InputError& error) {
    failed_ = true;
    std::fprintf(stderr, "lapservo: %s: the run goes on without a log\n", error.what());
  }
}

bool RunFolder::commit() {
  if (!folder_ || failed_) return !failed_;
  log_->commit();
  folder_->commit();
  std::printf("log, rig and controller: %s\n", path_.c_str());
  return true;
}

bool RunWatcher::on_tick(const ControlTick& tick) {
  if (!start_s_) start_s_ = tick.input.time_s;
  duration_s_ = tick.input.time_s - *start_s_;
  const std::optional<InstrumentTruth> true_now = truth();
  summary_.add(tick, true_now, arm_ ? block_of(*arm_) : "");
  folder_.add(tick, true_now);
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

}  // namespace lapservo::app
