#include "transports/ros2/ros2_transport.h"

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "lapservo/core/environment.h"
#include "lapservo/core/wall_clock.h"
#include "transports/ros2/dds_node.h"
#include "transports/ros2/reading.h"
#include "transports/ros2/ros2_names.h"
#include "transports/ros2/wire.h"

namespace lapservo::internal {
namespace {

// DDS matches each reader with the publishers of its type.
std::vector<const dds_topic_descriptor_t*> types_of(CommandType command) {
  switch (command) {
    case CommandType::joints:
      return {&sensor_msgs_msg_dds__JointState__desc};
    case CommandType::joint_servo:
      return {&crtk_msgs_msg_dds__JointServo__desc, &sensor_msgs_msg_dds__JointState__desc};
    case CommandType::pose:
      return {&geometry_msgs_msg_dds__PoseStamped__desc, &geometry_msgs_msg_dds__TransformStamped__desc};
    case CommandType::twist:
      return {&geometry_msgs_msg_dds__TwistStamped__desc};
    case CommandType::wrench:
      return {&geometry_msgs_msg_dds__WrenchStamped__desc};
    case CommandType::cartesian_state:
      return {&crtk_msgs_msg_dds__CartesianState__desc, &crtk_msgs_msg_dds__CartesianServo__desc};
    case CommandType::impedance:
      return {&crtk_msgs_msg_dds__CartesianImpedance__desc};
    case CommandType::on_or_off:
      return {&std_msgs_msg_dds__Bool__desc};
    case CommandType::nothing:
      return {&std_msgs_msg_dds__Empty__desc};
  }
  return {};
}

template <typename Message>
std::vector<Delivery> deliveries_of() {
  if constexpr (std::is_same_v<Message, OperatingStateMessage>)
    return {Delivery::latched, Delivery::reliable, Delivery::best_effort};
  if constexpr (std::is_same_v<Message, StringMessage> || std::is_same_v<Message, TrajectoryMessage>)
    return {Delivery::reliable, Delivery::best_effort};
  return {Delivery::best_effort};
}

// Messages of a topic that are kept until they are taken, of all its publishers: whoever floods it must not push
// another one's out. 30,000 texts a second take longer than 0.1 s to do so.
template <typename Message>
std::optional<int> depth_of() {
  if (std::is_same_v<Message, StringMessage>) return 5000;
  if (std::is_same_v<Message, OperatingStateMessage>) return 1000;
  return std::nullopt;
}

template <typename Message>
Transport::Publisher<Message> made_publisher(const std::shared_ptr<DdsNode>& node, const std::string& topic,
                                             Delivery delivery) {
  const dds_entity_t writer = node->create_writer(topic, Wire<Message>::descriptor(), delivery);
  const std::shared_ptr<void> end(nullptr, [node, writer](void*) { node->remove(writer); });
  return [writer, end](const Message& message) { Wire<Message>::write(writer, message); };
}

template <typename Message>
Transport::Subscription made_subscription(const std::shared_ptr<DdsNode>& node, const std::string& topic,
                                          const Transport::Handler<Message>& handler) {
  const auto taken = [handler](const void* wire, dds_instance_handle_t program) {
    Message message = Wire<Message>::read(*static_cast<const typename Wire<Message>::Type*>(wire));
    if constexpr (requires { message.source; }) message.source = program;
    handler(std::move(message));
  };
  return std::make_shared<Reading>(node, topic, Wire<Message>::descriptor(), deliveries_of<Message>(),
                                   depth_of<Message>(), taken);
}

}  // namespace

Ros2Transport::Ros2Transport(const std::string& node_name)
    : node_(std::make_shared<DdsNode>(node_name, domain_id(environment("ROS_DOMAIN_ID")))) {}

std::set<std::string> Ros2Transport::readers(const std::string& topic) const {
  return node_->readers(topic);
}

std::map<std::string, std::string> Ros2Transport::published() const {
  return node_->published();
}

double Ros2Transport::stamp_now_s() const {
  return since_1970_s();
}

void Ros2Transport::open(const std::string& topic, AnyPublisher& publisher) {
  const auto make = [&]<typename Message>(Publisher<Message>& one) {
    one = made_publisher<Message>(node_, topic,
                                  is_latched<Message> ? Delivery::latched
                                  : is_image<Message> ? Delivery::best_effort
                                                      : Delivery::reliable);
  };
  std::visit(make, publisher);
}

Transport::Publisher<JointMessage> Ros2Transport::set_point_publisher(const std::string& topic) {
  return made_publisher<JointMessage>(node_, topic, Delivery::set_point);
}

Transport::Subscription Ros2Transport::listen(const std::string& topic, const AnyHandler& handler) {
  const auto subscribe = [&]<typename Message>(const Handler<Message>& one) {
    return made_subscription<Message>(node_, topic, one);
  };
  const auto* const buttons = std::get_if<Handler<BoolMessage>>(&handler);
  if (!buttons) return std::visit(subscribe, handler);
  const Handler<JoyMessage> joys = [take = *buttons](JoyMessage&& message) { take(first_button(message)); };
  return std::make_shared<std::pair<Subscription, Subscription>>(subscribe(*buttons), subscribe(joys));
}

Transport::Subscription Ros2Transport::subscribe_commands(const std::string& topic, CommandType type,
                                                          Handler<CommandMessage> handler) {
  const auto taken = [handler](const void*, dds_instance_handle_t) { handler(CommandMessage()); };
  auto readings = std::make_shared<std::vector<std::unique_ptr<Reading>>>();
  for (const dds_topic_descriptor_t* descriptor : types_of(type))
    readings->push_back(std::make_unique<Reading>(
        node_, topic, *descriptor, std::vector{Delivery::reliable, Delivery::best_effort}, std::nullopt, taken));
  return readings;
}

}  // namespace lapservo::internal
