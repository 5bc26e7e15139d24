#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "apps/lapservo/cli/output_folder.h"
#include "apps/lapservo/commands/servo/servo_options.h"
#include "lapservo/robot/supervisor.h"
#include "lapservo/servo/convergence.h"
#include "lapservo/servo/servo_log.h"

namespace lapservo::app {

/// A line of a run's, at once.
void say(double time_s, const std::string& what);
/// The operator's action that ends a hold for that reason; empty where it ends by itself.
std::string_view operators_part(const ServoDecision& decision);
/// "track", "hold: marker_lost", "hold: endoscope_measured (...)" with the operator's part: the words of page, terminal
/// and window.
std::string state_text(const ServoDecision& decision);
/// The same, or why the arm is not moved.
std::string state_text(const ServoDecision& decision, const Supervisor& arm);
/// The word of Blocked for which the arm is not moved; empty while it is armed.
std::string block_of(const Supervisor& arm);

/// A run's log.csv, rig.yaml and controller.yaml.
class RunFolder {
 public:
  /// With the whole rig, whatever the method forgets of it: the frames can be tracked with it too. `truth`: the
  /// simulation's rig, kept in true_rig.yaml where it is another one.
  RunFolder(const ServoOptions& options, double duration_s, const Rig& rig, const ControllerConfig& controller,
            const Rig* truth = nullptr);
  /// A failure to write is reported once, and never ends the run.
  void add(const ControlTick& tick, const std::optional<InstrumentTruth>& truth);
  /// False where something could not be written.
  bool commit();

 private:
  OutputFolder folder_;
  ServoLog log_;
  bool failed_ = false;
};

/// The results of the run, for the last lines.
class Summary {
 public:
  /// By the truth, where it is known, else by the estimate. `block`: see block_of().
  void add(const ControlTick& tick, const std::optional<InstrumentTruth>& truth, const std::string& block = {});
  bool converged() const { return convergence_.reached_s().has_value(); }
  /// Converged and not in a hold at the end; when `strict`, with a registration that no image contradicted.
  bool succeeded(bool strict) const { return converged() && !held_at_end_ && !(strict && registration_contradicted()); }
  bool registration_contradicted() const { return contradicted_ > 0; }
  /// One line for each time that a camera_from_rcm was started that was measured anew.
  const std::vector<std::string>& endoscope_motions() const { return endoscope_motions_; }
  std::string text() const { return convergence_text() + holds_text(); }
  /// How long it held and why, how often the endoscope moved ...: a line each, each after a line's end.
  std::string holds_text() const;

 private:
  std::string convergence_text() const;
  void follow_registration(const ControlTick& tick);

  std::optional<double> start_s_, moved_s_;  ///< moved_s_: the endoscope, and not measured anew yet
  std::optional<Rigid3> camera_from_rcm_;
  std::vector<std::string> endoscope_motions_;
  long contradicted_ = 0;
  long ticks_ = 0;
  std::map<std::string, long> held_;
  std::optional<std::string> held_at_end_;  // by the last tick, and why
  Convergence convergence_;
};

}  // namespace lapservo::app
