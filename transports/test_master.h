#pragma once

#include <memory>
#include <string>

#ifdef LAPSERVO_ROS1
#include "transports/ros1/test_ros_master.h"
#endif

namespace lapservo::internal {

/// Lives while something needs this transport's wire: ROS 1's master.
inline std::shared_ptr<void> master_of([[maybe_unused]] const std::string& transport) {
#ifdef LAPSERVO_ROS1
  if (transport == "ros1") return std::make_shared<TestRosMaster>();
#endif
  return nullptr;
}

}  // namespace lapservo::internal
