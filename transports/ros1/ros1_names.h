#pragma once

#include <string>

namespace lapservo::internal {

/// Where a ROS 1 master listens.
struct MasterAddress {
  std::string host;
  int port = 0;
};
/// Host and port of a text as in ROS_MASTER_URI: "http://host:11311", with or without a final slash; localhost:11311
/// for an empty one. Throws InputError.
MasterAddress master_address(const std::string& text);
/// "http://host:port".
std::string to_string(const MasterAddress& address);

/// A topic's or arm's full name: "/dvrk/PSM1" of "PSM1" in the namespace "dvrk" or "/dvrk/"; "/PSM1" stays. Throws
/// InputError, naming `what`, for what is no name in ROS 1.
std::string resolved_ros1_name(const std::string& name, const std::string& ros_namespace, const std::string& what);

}  // namespace lapservo::internal
