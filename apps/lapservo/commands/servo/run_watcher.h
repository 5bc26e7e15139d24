#pragma once

#include <optional>
#include <string>

#include "apps/lapservo/cli/output_folder.h"
#include "apps/lapservo/commands/servo/changing_goal.h"
#include "apps/lapservo/commands/servo/servo_options.h"
#include "apps/lapservo/commands/servo/servo_page.h"
#include "lapservo/robot/supervisor.h"
#include "lapservo/servo/run_summary.h"
#include "lapservo/servo/servo_log.h"

namespace lapservo::app {

/// A line of a run's, at once.
void say(double time_s, const std::string& what);
/// A run's log.csv, rig.yaml and controller.yaml by --out; none without it.
class RunFolder {
 public:
  /// With the whole rig, whatever the method forgets of it: the frames can be tracked with it too. `truth`: the
  /// simulation's rig, kept in true_rig.yaml where it is another one.
  RunFolder(const ServoOptions& options, double duration_s, const Rig& rig, const ControllerConfig& controller,
            const Rig* truth = nullptr);
  /// A failure to write is reported once, and never ends the run.
  void add(const ControlTick& tick, const std::optional<InstrumentTruth>& truth);
  /// Keeps them and reports where; false where something could not be written.
  bool commit();

 private:
  const std::string path_;
  std::optional<OutputFolder> folder_;
  std::optional<ServoLog> log_;
  bool failed_ = false;
};

/// The user's view of a run: its log, its page and its last lines. A kind of run adds its own by follow().
class RunWatcher : public RunObserver {
 public:
  /// `arm`: none in a recording. `page`: where there is one.
  RunWatcher(const ServoOptions& options, RunFolder& folder, Supervisor* arm, ServoPage* page)
      : options_(options), folder_(folder), arm_(arm), page_(page) {}

  bool on_tick(const ControlTick& tick) final;
  const internal::RunSummary& summary() const { return summary_; }
  /// Since the first tick.
  double duration_s() const { return duration_s_; }

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

  RunFolder& folder_;
  Supervisor* arm_;
  ServoPage* page_;
  internal::RunSummary summary_;
  std::optional<double> start_s_;
  double duration_s_ = 0;
  std::string state_;
  bool is_new_state_ = false;
};

/// `lapservo servo` with a CRTK arm and a camera behind a transport. Returns the exit code: 0 when it converged.
int steer_arm(const ServoOptions& options);

/// `servo --replay BAG`: the loop over what a bag recorded of an arm and its camera, as it would have gone by it
/// without --enable-motion; what it decides moves nothing. Returns the exit code: 1 when it would have held throughout.
int decide_on_recording(const ServoOptions& options);

}  // namespace lapservo::app
