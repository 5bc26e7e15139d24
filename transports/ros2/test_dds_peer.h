#pragma once

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <string>

#include "transports/ros2/dds_node.h"
#include "transports/ros2/ros2_names.h"

namespace lapservo::internal {

inline std::uint32_t test_domain() {
  const char* const domain = std::getenv("ROS_DOMAIN_ID");
  return domain_id(domain ? domain : "");
}

/// A node as in another process: what passes between it and this process's others goes through sockets.
inline std::unique_ptr<DdsNode> node_elsewhere() {
  constexpr std::uint32_t handle = 300;  // of Cyclone DDS, for a second domain of the same number
  const std::string number = std::to_string(test_domain());
  const std::string outside = "<CycloneDDS><Domain><Discovery><ExternalDomainId>" + number +
                              "</ExternalDomainId></Discovery></Domain></CycloneDDS>";
  ::setenv("CYCLONEDDS_URI", outside.c_str(), 1);
  auto node = std::make_unique<DdsNode>("elsewhere", handle);
  ::unsetenv("CYCLONEDDS_URI");
  return node;
}

}  // namespace lapservo::internal
