#include "lapservo/servo/replay.h"

#include "lapservo/servo/image_features.h"
#include "lapservo/servo/servo.h"

namespace lapservo::internal {

std::optional<ReplayDifference> replay(const std::vector<LoggedTick>& log, const Rig& rig,
                                       const ControllerConfig& controller) {
  Servo servo(controller, rig);
  for (std::size_t i = 0; i < log.size(); ++i) {
    const auto fields = decision_fields(servo.step(log[i].input));
    for (std::size_t k = 0; k < fields.size(); ++k)
      if (fields[k] != log[i].decision[k])
        return ReplayDifference{i, decision_columns()[k], log[i].decision[k], fields[k]};
  }
  return std::nullopt;
}

}  // namespace lapservo::internal
