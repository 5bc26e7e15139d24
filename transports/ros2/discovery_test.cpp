#include "transports/ros2/discovery.h"

#include <dds/dds.h>

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"

namespace lapservo::internal::discovery_test {

using Peers = std::vector<std::string>;

TEST(Discovery, IsReadAsJazzyReadsIt) {
  struct Case {
    const char *localhost_only, *range, *peers;
    DiscoveryRange expected;
    Peers expected_peers;
  };
  const Case cases[]{
      {"", "", "", DiscoveryRange::subnet, {}},
      {"0", "", "a.example;;192.168.1.7;", DiscoveryRange::subnet, {"a.example", "192.168.1.7"}},
      {"1", "", "", DiscoveryRange::localhost, {}},
      {"1", "OFF", "10.0.0.1", DiscoveryRange::localhost, {}},  // the old variable goes before the new ones
      {"", "LOCALHOST", "10.0.0.1", DiscoveryRange::localhost, {"10.0.0.1"}},
      {"", "SUBNET", "10.0.0.1", DiscoveryRange::subnet, {"10.0.0.1"}},
      {"", "OFF", "10.0.0.1", DiscoveryRange::off, {}},
      {"", "SYSTEM_DEFAULT", "10.0.0.1", DiscoveryRange::system_default, {}},
  };
  for (const Case& c : cases) {
    const Discovery read = discovery_of(c.localhost_only, c.range, c.peers);
    EXPECT_EQ(read.range, c.expected) << c.range;
    EXPECT_EQ(read.peers, c.expected_peers) << c.peers;
  }
  EXPECT_EQ(testing::input_error([] { discovery_of("", "localhost", ""); }),
            "ROS_AUTOMATIC_DISCOVERY_RANGE: is localhost, expected LOCALHOST, SUBNET, OFF or SYSTEM_DEFAULT");
  EXPECT_EQ(testing::input_error([] { discovery_of("", "", "a;\"/><x"); }),
            "ROS_STATIC_PEERS: holds \"/><x, expected hosts or addresses between ;");
}

// With and without a network; the same interface twice, and what it does not know, Cyclone DDS refuses.
TEST(Discovery, CycloneTakesEachConfiguration) {
  std::uint32_t domain = 200;
  for (const auto range :
       {DiscoveryRange::localhost, DiscoveryRange::subnet, DiscoveryRange::off, DiscoveryRange::system_default})
    for (const bool network : {false, has_network()}) {
      const std::string text = cyclone_configuration({range, {"127.0.0.1"}}, network);
      const dds_entity_t created = dds_create_domain(domain++, text.c_str());
      EXPECT_GT(created, 0) << text;
      if (created > 0) dds_delete(created);
    }
}

TEST(Discovery, OnThisComputerOnlyNothingIsSentToTheNetwork) {
  for (const bool network : {false, true}) {
    const std::string text = cyclone_configuration({DiscoveryRange::localhost, {}}, network);
    EXPECT_NE(text.find("<AllowMulticast>false<"), std::string::npos);
    EXPECT_NE(text.find("<Peers><Peer address=\"127.0.0.1\"/></Peers>"), std::string::npos);
    EXPECT_EQ(text.find("autodetermine") != std::string::npos, network);
  }
}

TEST(Discovery, AWarningOfADroppedTypeHasARemedy) {
  EXPECT_TRUE(remedy_of_warning(
      "invalid parameter list (vendor 1.15, version 2.3): pid 75 (TYPE_INFORMATION) invalid, input = {}"));
  EXPECT_FALSE(remedy_of_warning("selected interface \"lo\" is not multicast-capable: disabling multicast"));
}

}  // namespace lapservo::internal::discovery_test
