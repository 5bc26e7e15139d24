#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/robot/supervisor.h"
#include "lapservo/servo/convergence.h"
#include "lapservo/servo/run.h"
#include "lapservo/servo/servo_log.h"

namespace lapservo::internal {

/// "track", "hold: marker_lost", "hold: endoscope_measured (...)" with the operator's part.
std::string state_text(const ServoDecision& decision);
/// The same, or why the arm is not moved.
std::string state_text(const ServoDecision& decision, const Supervisor& arm);
/// The word of Blocked for which the arm is not moved; empty while it is armed.
std::string block_of(const Supervisor& arm);

/// The results of the run, for the last lines.
class RunSummary {
 public:
  /// By the truth, where it is known, else by the loop's own estimate, which text() says. `block`: see block_of().
  void add(const ControlTick& tick, const std::optional<InstrumentTruth>& truth, const std::string& block = {});
  /// Within 1 px and 5 mrad for the last second and longer, holds aside.
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
  bool by_estimate_ = true;  ///< of the last tick's error
};

}  // namespace lapservo::internal
