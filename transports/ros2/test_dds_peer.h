#pragma once

#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <dds/dds.h>
#include <memory>
#include <string>
#include <thread>

#include "lapservo/testing/wait_for.h"
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

/// Until a writer of node_elsewhere() has so many readers, and these its first heartbeat: they deliver nothing before.
inline void wait_for_readers(dds_entity_t writer, int count) {
  testing::wait_for([&] { return dds_get_matched_subscriptions(writer, nullptr, 0) >= count; });
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
}

}  // namespace lapservo::internal
