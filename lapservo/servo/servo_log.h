#pragma once

#include <cstddef>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/feature_model.h"
#include "lapservo/core/bounded_queue.h"
#include "lapservo/core/row_file.h"
#include "lapservo/rig/rig.h"
#include "lapservo/servo/servo_decision.h"

namespace lapservo::internal {

/// Where the instrument truly is, which only a simulation knows.
struct InstrumentTruth {
  Eigen::Vector4d q = Eigen::Vector4d::Zero();
  std::optional<Eigen::Vector4d> features;  ///< absent where the camera sees none
};
InstrumentTruth truth_at(const FeatureModel& true_model, const JointVector& q);

/// A run's complete log, one row a control tick, written as they come (see RowFile) in a thread of its own: a disk that
/// is busy does not delay the loop. Numbers are written so that reading them gives the same bits.
class ServoLog {
 public:
  /// Throws InputError when the file can't be written.
  explicit ServoLog(const std::filesystem::path& path);
  ~ServoLog();

  /// Does not wait for the disk. Throws InputError when a row before could not be written, or too many wait.
  void add(const ServoInput& input, const ServoDecision& decision, const std::optional<InstrumentTruth>& truth);
  /// Waits for all rows; throws InputError when one could not be written.
  void commit();

 private:
  void write_rows();

  static constexpr std::size_t most_waiting = 16384;  ///< of some 1.5 kB
  std::filesystem::path path_;
  RowFile file_;
  long tick_ = 0;
  BoundedQueue<std::string> rows_{most_waiting};
  std::exception_ptr failure_;  ///< set before rows_ is cancelled
  std::jthread thread_;         ///< last: it uses the others
};

/// A row of a log: the inputs, and the decision as it was written.
struct LoggedTick {
  ServoInput input;
  std::vector<std::string> decision;  ///< as decision_fields() has it
};

/// The decision's fields of a row.
std::vector<std::string> decision_fields(const ServoDecision& decision);

/// Throws InputError naming file, line and column.
std::vector<LoggedTick> read_servo_log(const std::filesystem::path& path);

/// Puts a log's inputs through a servo of the same configuration again. The first tick whose decision differs in any
/// bit, or nullopt.
struct ReplayDifference {
  std::size_t tick = 0;
  std::string column, logged, replayed;
};
std::optional<ReplayDifference> replay(const std::vector<LoggedTick>& log, const Rig& rig,
                                       const ControllerConfig& controller);

}  // namespace lapservo::internal
