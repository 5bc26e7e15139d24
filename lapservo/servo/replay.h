#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/control/controller_config.h"
#include "lapservo/rig/rig.h"
#include "lapservo/servo/servo_log.h"

namespace lapservo::internal {

/// Puts a log's inputs through a servo of the same configuration again. The first tick whose decision differs in any
/// bit, or nullopt.
struct ReplayDifference {
  std::size_t tick = 0;
  std::string column, logged, replayed;
};
std::optional<ReplayDifference> replay(const std::vector<LoggedTick>& log, const Rig& rig,
                                       const ControllerConfig& controller);

}  // namespace lapservo::internal
