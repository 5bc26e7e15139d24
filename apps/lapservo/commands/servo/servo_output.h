#pragma once

#include <memory>
#include <optional>
#include <string>

#include "apps/lapservo/cli/output_folder.h"
#include "apps/lapservo/commands/servo/servo_options.h"
#include "lapservo/servo/run_summary.h"
#include "lapservo/servo/servo_log.h"

namespace lapservo::app {

/// A line of a run's, at once.
void say(double time_s, const std::string& what);
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

/// By --out; none without it.
std::unique_ptr<RunFolder> run_folder(const ServoOptions& options, double duration_s, const Rig& rig,
                                      const ControllerConfig& controller, const Rig* truth = nullptr);

}  // namespace lapservo::app
