#pragma once

#include <future>
#include <memory>
#include <optional>
#include <string>

#include "lapservo/servo/run.h"

namespace lapservo::app {

/// The trajectory of a run, until somebody wants another goal instead. All in the loop's thread.
class ChangingGoal {
 public:
  /// `run` must outlive it.
  ChangingGoal(Trajectory first, const RunConfig& run);

  /// For run(): what counts at each time.
  Trajectory trajectory() const;

  /// Begins once it has been checked, at its time 0; the one wanted last counts. `name`: set_point, tip_goal, ...
  void want(const std::string& name, double duration_s, Trajectory trajectory);
  /// Once a tick: what there is to say of what was wanted.
  std::optional<std::string> follow(const ControlTick& tick);

 private:
  struct Wanted {
    std::string name;
    double duration_s = 0;
    Trajectory trajectory;
    int registration = 0;  ///< ServoDecision::registration when it was requested
  };
  std::optional<std::string> result(const ControlTick& tick);
  void check_next(const ControlTick& tick);

  const RunConfig& run_;
  std::shared_ptr<Trajectory> now_;
  std::optional<Wanted> wanted_;  // to be checked next
  Wanted asked_;
  std::future<std::string> refusal_;  // of the checked goal, empty when it can be followed; last: it uses the others
};

}  // namespace lapservo::app
