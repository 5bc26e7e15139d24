#pragma once

#include <map>
#include <memory>
#include <set>
#include <string>

#include "lapservo/crtk/transport.h"

namespace lapservo::internal {

class DdsNode;

/// The ROS 2 wire: topics, types and QoS as ROS 2's nodes have them, in the domain of ROS_DOMAIN_ID. Joint states,
/// setpoints and images are read best effort and operating states and strings by whatever is offered, so that every
/// publisher matches. Throws InputError for a topic or a domain that is none, std::runtime_error when DDS fails.
class Ros2Transport : public Transport {
 public:
  explicit Ros2Transport(const std::string& node_name);

  Publisher<JointMessage> set_point_publisher(const std::string& topic) override;
  Subscription subscribe_commands(const std::string& topic, CommandType type, Handler<CommandMessage> handler) override;
  std::set<std::string> readers(const std::string& topic) const override;
  std::map<std::string, std::string> published() const override;

 private:
  void open(const std::string& topic, AnyPublisher& publisher) override;
  Subscription listen(const std::string& topic, const AnyHandler& handler) override;

  std::shared_ptr<DdsNode> node_;  // publishers and subscriptions keep it
};

}  // namespace lapservo::internal
