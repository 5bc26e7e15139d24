#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "lapservo/robot/clock.h"
#include "lapservo/robot/robot.h"
#include "lapservo/robot/supervisor_state.h"
#include "lapservo/robot/suspension_watch.h"

namespace lapservo {

/// Stands between a loop and its arm and decides whether the arm moves: see SupervisorState for the states and their
/// transitions. Its construction is the first start. While it holds, the arm reports to the loop that it is not
/// enabled; no path reaches it, the last one brakes to rest, and then the arm is released. All calls come from the
/// loop's thread.
class Supervisor : public Robot {
 public:
  /// Both must outlive it.
  Supervisor(Robot& robot, const Clock& clock, const SupervisorConfig& config = {});

  /// Goes one step on.
  JointState state() override;
  std::vector<JointReading> readings() override { return robot_.readings(); }
  void send(const JointPath& path) override;
  void release() override { robot_.release(); }
  bool is_simulated() const override { return robot_.is_simulated(); }

  // These count in the next step.
  void stop(Commander who) { input_.stops.insert(who); }
  /// `said_s`: on the clock; `force`: whoever holds.
  void start(Commander who, double said_s, bool force = false);
  /// The loop's decision: empty where the arm is to move, else why it holds, in words. `event`: Blocked::displaced or
  /// Blocked::loop_held where that needs a start at once.
  void tell_loop(const std::string& hold_reason, Blocked event = Blocked::none);
  /// Something that needs a start, seen outside of the loop's step; it counts in the next step in which the arm is
  /// ready, armed or not.
  void report(Blocked event) { reported_ = event; }
  /// Whether the operator presses what has to be pressed, now.
  void watch_operator(std::function<bool()> is_present) { is_present_ = std::move(is_present); }
  /// The arm comes to rest and stays held, whatever is said.
  void end();

  bool armed() const { return state_.phase == SupervisorState::Phase::armed; }
  /// Held until a start; else the arm moves, or will as soon as it is ready.
  bool held() const { return state_.phase == SupervisorState::Phase::held; }
  /// Whether a start counts now, as far as the arm and its operator go.
  bool can_start() const;
  /// Why the arm is not moved: none while armed.
  Blocked blocked() const;
  /// Why and what is to be done, in one line: "hold: not_homed (home the arm, then start)"; empty while armed.
  std::string text() const;

 private:
  std::string remedy(Blocked obstacle) const;

  Robot& robot_;
  const Clock& clock_;
  SupervisorConfig config_;
  SupervisorInput input_;
  SupervisorState state_;
  std::optional<JointPath> path_;  ///< the last one sent
  std::string operating_state_;    ///< as the arm calls it
  std::string loop_reason_;
  Blocked reported_ = Blocked::none;
  std::function<bool()> is_present_;
  SuspensionWatch suspension_;
};

}  // namespace lapservo
