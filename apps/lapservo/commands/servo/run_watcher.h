#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "apps/lapservo/commands/servo/changing_goal.h"
#include "apps/lapservo/commands/servo/servo_options.h"
#include "apps/lapservo/commands/servo/servo_output.h"
#include "apps/lapservo/commands/servo/servo_page.h"
#include "lapservo/robot/supervisor.h"
#include "lapservo/servo/run_summary.h"

namespace lapservo::app {

/// The user's view of a run: its log, its page and its last lines. A kind of run adds its own by follow().
class RunWatcher : public RunObserver {
 public:
  /// `arm`: none in a recording. `page`: where there is one.
  RunWatcher(const ServoOptions& options, std::unique_ptr<RunFolder> folder, Supervisor* arm, ServoPage* page)
      : options_(options), folder_(std::move(folder)), arm_(arm), page_(page) {}

  bool on_tick(const ControlTick& tick) final;
  const internal::RunSummary& summary() const { return summary_; }
  /// Since the first tick.
  double duration_s() const { return duration_s_; }
  /// Keeps the log and reports where; false where something could not be written.
  bool commit_log();

 protected:
  /// `time_s`: since the first tick. False ends the run.
  virtual bool follow(const ControlTick& tick, double time_s) = 0;
  virtual std::optional<InstrumentTruth> truth() const { return std::nullopt; }
  /// Passes the page's goals of the tip on, and reports on all goals.
  void follow_goal(ChangingGoal& goal, const ControlTick& tick, double time_s);
  /// In words, of this tick; and whether it is another one than the tick's before.
  const std::string& state() const { return state_; }
  bool is_new_state() const { return is_new_state_; }

  const ServoOptions& options_;

 private:
  bool ends_by_page(const ControlTick& tick, double time_s);

  std::unique_ptr<RunFolder> folder_;
  Supervisor* arm_;
  ServoPage* page_;
  internal::RunSummary summary_;
  std::optional<double> start_s_;
  double duration_s_ = 0;
  std::string state_;
  bool is_new_state_ = false;
};

}  // namespace lapservo::app
