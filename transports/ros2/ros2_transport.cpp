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
#include "transports/ros2/dds_node.h"
#include "transports/ros2/reading.h"
#include "transports/ros2/ros2_names.h"
#include "transports/ros2/wire.h"

namespace lapservo::internal {
namespace {

// DDS matches each reader with the publishers of its type.
const std::map<CommandType, std::vector<const dds_topic_descriptor_t*>> types_of_commands{
    {CommandType::joints, {&sensor_msgs_msg_dds__JointState__desc}},
    {CommandType::joint_servo, {&crtk_msgs_msg_dds__JointServo__desc, &sensor_msgs_msg_dds__JointState__desc}},
    {CommandType::pose, {&geometry_msgs_msg_dds__PoseStamped__desc, &geometry_msgs_msg_dds__TransformStamped__desc}},
    {CommandType::twist, {&geometry_msgs_msg_dds__TwistStamped__desc}},
    {CommandType::wrench, {&geometry_msgs_msg_dds__WrenchStamped__desc}},
    {CommandType::cartesian_state,
     {&crtk_msgs_msg_dds__CartesianState__desc, &crtk_msgs_msg_dds__CartesianServo__desc}},
    {CommandType::impedance, {&crtk_msgs_msg_dds__CartesianImpedance__desc}},
    {CommandType::on_or_off, {&std_msgs_msg_dds__Bool__desc}},
    {CommandType::nothing, {&std_msgs_msg_dds__Empty__desc}}};

template <typename Message>
std::vector<Delivery> deliveries_of() {
  if constexpr (std::is_same_v<Message, OperatingStateMessage>)
    return {Delivery::latched, Delivery::reliable, Delivery::best_effort};
  if constexpr (std::is_same_v<Message, StringMessage> || std::is_same_v<Message, TextMessage> ||
                std::is_same_v<Message, TrajectoryMessage>)
    return {Delivery::reliable, Delivery::best_effort};
  return {Delivery::best_effort};
}

template <typename Message>
Transport::Publisher<Message> made_publisher(const std::shared_ptr<DdsNode>& node, const std::string& topic,
                                             Delivery delivery) {
  const dds_entity_t writer = node->create_writer(topic, Wire<Message>::descriptor(), delivery);
  const std::shared_ptr<void> end(nullptr, [node, writer](void*) { node->remove(writer); });
  return [writer, end](const Message& message) { Wire<Message>::write(writer, message); };
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
  const auto subscribe = [&]<typename Message>(const Handler<Message>& one) -> Subscription {
    const auto taken = [one](const void* wire, dds_instance_handle_t program) {
      Message message = Wire<Message>::read(*static_cast<const typename Wire<Message>::Type*>(wire));
      if constexpr (requires { message.source; }) message.source = program;
      one(std::move(message));
    };
    return std::make_shared<Reading>(node_, topic, Wire<Message>::descriptor(), deliveries_of<Message>(),
                                     depth<Message>, taken);
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
  for (const dds_topic_descriptor_t* descriptor : types_of_commands.at(type))
    readings->push_back(std::make_unique<Reading>(
        node_, topic, *descriptor, std::vector{Delivery::reliable, Delivery::best_effort}, std::nullopt, taken));
  return readings;
}

}  // namespace lapservo::internal
