#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lapservo/core/row_file.h"
#include "lapservo/servo/servo.h"

namespace lapservo {

/// One period of a run: what the loop went by, what it decided and, in a simulation, the truth.
struct ServoRecord {
  ServoInput input;
  ServoDecision decision;
  std::optional<Eigen::Vector4d> true_q, true_features;
};

/// A run's complete log, one row a period, written as they come (see RowFile). Numbers are written so that reading them
/// gives the same bits.
class ServoLog {
 public:
  /// Throws InputError when the file can't be written.
  explicit ServoLog(const std::filesystem::path& path);
  void add(const ServoRecord& record);
  void commit() { file_.commit(); }

 private:
  RowFile file_;
  long period_ = 0;
};

/// A row of a log: the inputs, and the decision as it was written.
struct LoggedPeriod {
  ServoInput input;
  std::vector<std::string> decision;  ///< fields, in the order of decision_columns()
};

const std::vector<std::string>& decision_columns();
std::vector<std::string> decision_fields(const ServoDecision& decision);

/// Throws InputError naming file, line and column.
std::vector<LoggedPeriod> read_servo_log(const std::filesystem::path& path);

}  // namespace lapservo
