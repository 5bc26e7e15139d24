#pragma once

#include <map>
#include <memory>
#include <set>
#include <string>

#include "lapservo/crtk/transport.h"

namespace lapservo::internal {

class Ros1Node;
class Ros1Readers;

/// ROS 1 by roscpp: topics and types as ROS 1's nodes have them, at the master of ROS_MASTER_URI; ROS_NAMESPACE, ROS_IP
/// and ROS_HOSTNAME as everywhere in ROS 1. All transports of a process are one node, of the first one's name, and none
/// receives another one's messages of the same process. Each subscription has its own thread. A topic of another type,
/// and unreadable messages, which are dropped, are reported on stderr, once a topic. Throws InputError for an invalid
/// topic or when no master answers, std::runtime_error when roscpp fails.
class Ros1Transport : public Transport {
 public:
  explicit Ros1Transport(const std::string& node_name);

  Publisher<JointMessage> set_point_publisher(const std::string& topic) override;
  Subscription subscribe_commands(const std::string& topic, CommandType type, Handler<CommandMessage> handler) override;
  std::set<std::string> readers(const std::string& topic) const override;
  std::map<std::string, std::string> published() const override;

 private:
  void open(const std::string& topic, AnyPublisher& publisher) override;
  Subscription listen(const std::string& topic, const AnyHandler& handler) override;

  std::shared_ptr<Ros1Node> node_;        // publishers and subscriptions keep it
  std::shared_ptr<Ros1Readers> readers_;  // publishers keep it
};

}  // namespace lapservo::internal
