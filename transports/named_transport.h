#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "lapservo/crtk/transport.h"
#ifdef LAPSERVO_ROS1
#include "transports/ros1/ros1_transport.h"
#endif
#ifdef LAPSERVO_ROS2
#include "transports/ros2/ros2_transport.h"
#endif

namespace lapservo::internal {

/// The transports of this build.
inline std::vector<std::string> named_transports() {
  return {
#ifdef LAPSERVO_ROS2
      "ros2",
#endif
#ifdef LAPSERVO_ROS1
      "ros1",
#endif
  };
}

/// "ros1" or "ros2", where they are built with it (LAPSERVO_ROS1, LAPSERVO_ROS2). Throws std::invalid_argument for
/// others.
inline std::unique_ptr<Transport> named_transport(const std::string& name, [[maybe_unused]] const std::string& node) {
#ifdef LAPSERVO_ROS1
  if (name == "ros1") return std::make_unique<Ros1Transport>(node);
#endif
#ifdef LAPSERVO_ROS2
  if (name == "ros2") return std::make_unique<Ros2Transport>(node);
#endif
  throw std::invalid_argument("no transport " + name + " in this build");
}

}  // namespace lapservo::internal
