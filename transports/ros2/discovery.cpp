#include "transports/ros2/discovery.h"

#include <algorithm>
#include <cstring>
#include <ifaddrs.h>
#include <memory>
#include <net/if.h>
#include <sstream>
#include <sys/socket.h>
#include <unistd.h>

#include "lapservo/core/error.h"
#include "lapservo/core/words.h"

namespace lapservo::internal {
namespace {

constexpr Words<DiscoveryRange, 4> range_words{{{DiscoveryRange::localhost, "LOCALHOST"},
                                                {DiscoveryRange::subnet, "SUBNET"},
                                                {DiscoveryRange::off, "OFF"},
                                                {DiscoveryRange::system_default, "SYSTEM_DEFAULT"}}};
static_assert(names_all(range_words, DiscoveryRange::system_default));

// None of XML's characters either.
bool is_host(const std::string& text) {
  return std::all_of(text.begin(), text.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || std::strchr(".-:_", c);
  });
}

std::vector<std::string> hosts_of(const std::string& text) {
  std::vector<std::string> hosts;
  std::istringstream list(text);
  for (std::string host; std::getline(list, host, ';');) {
    if (!is_host(host))
      throw InputError("ROS_STATIC_PEERS", "holds " + host + ", expected hosts or addresses between ;");
    if (!host.empty()) hosts.push_back(host);
  }
  return hosts;
}

std::string peers_of(const std::vector<std::string>& hosts) {
  if (hosts.empty()) return {};
  std::string text = "<Peers>";
  for (const std::string& host : hosts) text += "<Peer address=\"" + host + "\"/>";
  return text + "</Peers>";
}

// Well-known ports: without multicast, participants are queried one by one.
constexpr const char* known_ports =
    "<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>";

// Fast DDS announces the network card's address on localhost, too. The same interface twice is refused.
std::string interfaces_of_localhost(bool has_network) {
  const std::string network = has_network ? "<NetworkInterface autodetermine=\"true\"/>" : "";
  return "<AllowMulticast>false</AllowMulticast><Interfaces><NetworkInterface address=\"127.0.0.1\"/>" + network +
         "</Interfaces>";
}

}  // namespace

Discovery discovery_of(const std::string& localhost_only, const std::string& range, const std::string& static_peers) {
  if (localhost_only == "1") return {DiscoveryRange::localhost, {}};
  const auto known = range.empty() ? DiscoveryRange::subnet : read_word(range_words, range);
  if (!known)
    throw InputError("ROS_AUTOMATIC_DISCOVERY_RANGE",
                     "is " + range + ", expected LOCALHOST, SUBNET, OFF or SYSTEM_DEFAULT");
  const bool peered = *known == DiscoveryRange::localhost || *known == DiscoveryRange::subnet;
  return {*known, peered ? hosts_of(static_peers) : std::vector<std::string>()};
}

std::string cyclone_configuration(const Discovery& discovery, bool has_network) {
  std::vector<std::string> peers = discovery.peers;
  // Whole images in few packets.
  std::string general = "<MaxMessageSize>65500B</MaxMessageSize>", found = "<SPDPInterval>1s</SPDPInterval>";
  switch (discovery.range) {
    case DiscoveryRange::localhost:
      general += interfaces_of_localhost(has_network);
      peers.insert(peers.begin(), "127.0.0.1");
      found += known_ports + peers_of(peers);
      break;
    case DiscoveryRange::subnet:
      found += known_ports + peers_of(peers);
      break;
    case DiscoveryRange::off:
      general += "<AllowMulticast>false</AllowMulticast>";
      found +=
          "<ParticipantIndex>none</ParticipantIndex><Tag>ros_discovery_off_" + std::to_string(::getpid()) + "</Tag>";
      break;
    case DiscoveryRange::system_default:
      break;
  }
  // Without key hashes Fast DDS misses that a participant leaves. The receive buffer holds some images, as far as
  // net.core.rmem_max goes.
  return "<CycloneDDS><Domain id=\"any\"><General>" + general + "</General><Discovery>" + found +
         "</Discovery><Internal><GenerateKeyhash>true</GenerateKeyhash>"
         "<SocketReceiveBufferSize min=\"default\" max=\"16MB\"/></Internal></Domain></CycloneDDS>";
}

bool has_network() {
  ifaddrs* all = nullptr;
  if (::getifaddrs(&all) != 0) return false;
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> owner(all, &::freeifaddrs);
  for (const ifaddrs* at = all; at; at = at->ifa_next)
    if (at->ifa_addr && at->ifa_addr->sa_family == AF_INET && (at->ifa_flags & IFF_UP) &&
        !(at->ifa_flags & IFF_LOOPBACK))
      return true;
  return false;
}

std::optional<std::string> remedy_of_warning(const std::string& warning) {
  if (warning.find("TYPE_INFORMATION") == std::string::npos) return std::nullopt;
  return "a program's topics are dropped, since Cyclone DDS can't read the type information that it sends. Generate "
         "its types by fastddsgen -no-typeobjectsupport, or call auto_fill_type_information(false) on its TypeSupport, "
         "as ROS 2's nodes do";
}

}  // namespace lapservo::internal
