#pragma once

#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/core/error.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/robot.h"

namespace lapservo::python {

/// Remembers whether its limits are the arm's own, which an arm that is not simulated needs, and by what its window and
/// those limits are.
struct Controller : ControllerConfig {
  bool has_joint_limits = false;
  Camera camera{};
  std::optional<Joints> joints{};

  /// Throws InputError naming `source` where its window or its limits are those of another rig.
  void expect_own(const Rig& rig, const char* source) const {
    if (rig.camera != camera)
      throw InputError(source, "rig.camera", "another one",
                       "that of the controller's rig: make a Controller of this rig");
    if (has_joint_limits && rig.instruments.front().joints != joints)
      throw InputError(source, "rig.instruments[0].joints", "others",
                       "those by which the controller reads its joint_limits: make a Controller of this rig");
  }
};

/// A robot that moves one instrument only has it as a base.
struct ArmOf {
  Instrument instrument;
};

/// Whether this thread's call is the loop's, passed on by a robot in Python; else it is an onlooker's.
inline thread_local bool loop_asks = false;

/// Readings as Python has them.
inline std::vector<std::pair<double, Eigen::Vector4d>> pairs_of(const std::vector<JointReading>& readings) {
  std::vector<std::pair<double, Eigen::Vector4d>> pairs;
  for (const JointReading& reading : readings) pairs.emplace_back(reading.time_s, reading.q.vector());
  return pairs;
}

}  // namespace lapservo::python
