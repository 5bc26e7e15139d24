#pragma once

#include <optional>
#include <string>
#include <vector>

namespace lapservo::internal {

/// How far ROS 2's nodes look for one another.
enum class DiscoveryRange { localhost, subnet, off, system_default };

/// Discovery as ROS 2 Jazzy reads it from the environment.
struct Discovery {
  DiscoveryRange range = DiscoveryRange::subnet;
  std::vector<std::string> peers;  ///< hosts or addresses, in localhost and subnet only
};

/// From the texts of ROS_LOCALHOST_ONLY, which "1" lets go before the others, ROS_AUTOMATIC_DISCOVERY_RANGE and
/// ROS_STATIC_PEERS (between semicolons). Throws InputError for another range and for what is no host.
Discovery discovery_of(const std::string& localhost_only, const std::string& range, const std::string& static_peers);

/// Cyclone DDS's configuration. `has_network`: there is an interface beside loopback.
std::string cyclone_configuration(const Discovery& discovery, bool has_network);

/// Whether this computer has an interface with an IPv4 address beside loopback.
bool has_network();

/// The remedy to a warning of Cyclone DDS; nullopt for one that a user need not see.
std::optional<std::string> remedy_of_warning(const std::string& warning);

}  // namespace lapservo::internal
