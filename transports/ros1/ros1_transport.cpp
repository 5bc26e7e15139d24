#include "transports/ros1/ros1_transport.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <xmlrpcpp/XmlRpcValue.h>

#include "lapservo/core/environment.h"
#include "transports/ros1/ros1_names.h"
#include "transports/ros1/ros1_node.h"
#include "transports/ros1/ros1_subscription.h"

namespace lapservo::internal {

// Who reads what this transport publishes. roscpp reports it in a queue.
class Ros1Readers {
 public:
  ros::CallbackQueue* queue() { return &queue_; }
  // Called from the queue.
  void add(const ros::SingleSubscriberPublisher& reader) {
    if (reader.getSubscriberName() != ros::this_node::getName())
      names_[reader.getTopic()].insert(reader.getSubscriberName());
  }
  void remove(const ros::SingleSubscriberPublisher& reader) {
    auto& names = names_[reader.getTopic()];
    if (const auto one = names.find(reader.getSubscriberName()); one != names.end()) names.erase(one);
  }
  std::set<std::string> of(const std::string& topic) {
    const std::lock_guard lock(mutex_);
    queue_.callAvailable();
    const auto& names = names_[topic];
    return {names.begin(), names.end()};
  }

 private:
  std::mutex mutex_;
  ros::CallbackQueue queue_;
  std::map<std::string, std::multiset<std::string>> names_;  // by connections
};

namespace {

constexpr std::uint32_t few = 10;    // as ROS 2 keeps by default
constexpr std::uint32_t newest = 2;  // of images

std::string full_name(const std::string& topic) {
  return resolved_ros1_name(topic, environment("ROS_NAMESPACE"), "topic");
}

template <typename Message>
Transport::Publisher<Message> made_publisher(const std::shared_ptr<Ros1Node>& node,
                                             const std::shared_ptr<Ros1Readers>& readers, const std::string& topic,
                                             std::uint32_t queue_size, bool latched = false) {
  ros::AdvertiseOptions options;
  options.init<Ros1Type<Message>>(
      full_name(topic), queue_size, [to = readers.get()](const auto& reader) { to->add(reader); },
      [to = readers.get()](const auto& reader) { to->remove(reader); });
  options.latch = latched;
  options.callback_queue = readers->queue();
  const ros::Publisher to = ros::NodeHandle().advertise(options);
  if (!to) throw std::runtime_error("ROS: can't publish " + topic);
  const auto end = [node, readers](ros::Publisher* publisher) {
    const std::shared_ptr<ros::Publisher> kept(publisher);
    using Both = std::pair<std::shared_ptr<ros::Publisher>, std::shared_ptr<Ros1Readers>>;
    node->end([&] { kept->shutdown(); }, std::make_shared<Both>(kept, readers));
  };
  const std::shared_ptr<ros::Publisher> shared(new ros::Publisher(to), end);
  return [shared, latched](const Message& message) {
    if (latched || shared->getNumSubscribers() > 0) shared->publish(ros1_message(message));
  };
}

}  // namespace

std::optional<std::string> other_type_on(const std::string& topic, const std::string& type) {
  ros::master::V_TopicInfo topics;
  if (!ros::master::getTopics(topics)) return std::nullopt;
  for (const auto& published : topics)
    if (published.name == topic && published.datatype != type && published.datatype != "*") return published.datatype;
  return std::nullopt;
}

std::optional<std::string> address_of_node(const std::string& node) {
  XmlRpc::XmlRpcValue request, response, address;
  request[0] = ros::this_node::getName();
  request[1] = node;
  const bool known = ros::master::execute("lookupNode", request, response, address, false) &&
                     address.getType() == XmlRpc::XmlRpcValue::TypeString;
  return known ? std::optional<std::string>(static_cast<std::string&>(address)) : std::nullopt;
}

Ros1Transport::Ros1Transport(const std::string& node_name)
    : node_(Ros1Node::get(node_name)), readers_(std::make_shared<Ros1Readers>()) {}

std::set<std::string> Ros1Transport::readers(const std::string& topic) const {
  return readers_->of(full_name(topic));
}

std::map<std::string, std::string> Ros1Transport::published() const {
  ros::master::V_TopicInfo topics;
  if (!node_->answers() || !ros::master::getTopics(topics)) return {};
  ros::V_string own;
  ros::this_node::getAdvertisedTopics(own);
  std::map<std::string, std::string> published;
  for (const auto& topic : topics)
    if (std::find(own.begin(), own.end(), topic.name) == own.end()) published[topic.name] = topic.datatype;
  return published;
}

void Ros1Transport::open(const std::string& topic, AnyPublisher& made) {
  const auto make = [&]<typename Message>(Publisher<Message>& one) {
    one = made_publisher<Message>(node_, readers_, topic, is_image<Message> ? newest : few, is_latched<Message>);
  };
  std::visit(make, made);
}

Transport::Publisher<JointMessage> Ros1Transport::set_point_publisher(const std::string& topic) {
  return made_publisher<JointMessage>(node_, readers_, topic, 1);
}

Transport::Subscription Ros1Transport::listen(const std::string& topic, const AnyHandler& handler) {
  const auto subscribe = [&]<typename Message>(const Handler<Message>& one) -> Subscription {
    const std::uint32_t queue_size = is_image<Message> ? newest : depth<Message>.value_or(few);
    return std::make_shared<Ros1Subscription<Message>>(node_, full_name(topic), queue_size, one);
  };
  return std::visit(subscribe, handler);
}

Transport::Subscription Ros1Transport::subscribe_commands(const std::string& topic, CommandType,
                                                          Handler<CommandMessage> handler) {
  return std::make_shared<Ros1Subscription<CommandMessage>>(node_, full_name(topic), few, handler);
}

}  // namespace lapservo::internal
