#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <set>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>

#include "lapservo/crtk/messages.h"
#include "transports/ros1/ros1_decoder.h"
#include "transports/ros1/ros1_messages.h"
#include "transports/ros1/ros1_node.h"

namespace lapservo::internal {

/// The content of a topic that carries Message: empty when it can't be read. roscpp's own deserialiser would reserve
/// the size that a message claims.
template <typename Message>
struct Ros1Received {
  std::optional<Message> message;
  std::string type;  ///< as its publisher names it
};

/// Whether a topic of any type carries it.
template <typename Message>
constexpr bool is_of_any_type = std::is_same_v<Message, BoolMessage> || std::is_same_v<Message, CommandMessage>;

/// The types that carry Message, in words.
template <typename Message>
std::string ros1_types() {
  if constexpr (std::is_same_v<Message, BoolMessage>) return "std_msgs/Bool or sensor_msgs/Joy";
  if constexpr (std::is_same_v<Message, CommandMessage>) return "a command";
  if constexpr (!is_of_any_type<Message>) return ros::message_traits::datatype<Ros1Type<Message>>();
}

/// The type of a topic that is published by the master's word, when it is another one.
std::optional<std::string> other_type_on(const std::string& topic, const std::string& type);

/// Where a node's process answers, by the master's word; nullopt where it does not know.
std::optional<std::string> address_of_node(const std::string& node);

/// A topic with the thread that takes from it, until destroyed.
template <typename Message>
class Ros1Subscription {
 public:
  Ros1Subscription(std::shared_ptr<Ros1Node> node, const std::string& topic, std::uint32_t queue_size,
                   std::function<void(Message&&)> handler)
      : node_(std::move(node)), topic_(topic), handler_(std::move(handler)) {
    ros::SubscribeOptions options;
    options.initByFullCallbackType<const Event&>(topic, queue_size, [this](const Event& event) { take(event); });
    options.callback_queue = queue_.get();
    options.transport_hints = ros::TransportHints().tcpNoDelay();
    subscriber_ = ros::NodeHandle().subscribe(options);
    if (!subscriber_) throw std::runtime_error("ROS: can't subscribe to " + topic);
    thread_ = std::thread([this] { work(); });
  }
  ~Ros1Subscription() {
    ended_ = true;
    queue_->disable();
    thread_.join();
    using Both = std::pair<std::shared_ptr<ros::CallbackQueue>, ros::Subscriber>;
    node_->end([this] { subscriber_.shutdown(); }, std::make_shared<Both>(queue_, subscriber_));
  }
  Ros1Subscription(const Ros1Subscription&) = delete;
  Ros1Subscription& operator=(const Ros1Subscription&) = delete;

 private:
  using Event = ros::MessageEvent<Ros1Received<Message>>;  // not const: its own copy, where it is not the only one

  struct Sender {
    std::uint64_t source;
    Latched latched = Latched::no;
  };

  void work() {
    constexpr double longest_s = 30;
    for (double moment_s = 1; !ended_; moment_s = std::min(2 * moment_s, longest_s)) {
      queue_->callAvailable(ros::WallDuration(moment_s));
      if constexpr (!is_of_any_type<Message>)
        if (!ended_ && !connected_) look_for_other_types();
    }
  }
  void take(const Event& event) {
    connected_ = true;
    if (!event.getConnectionHeaderPtr() || event.getPublisherName() == ros::this_node::getName()) return;
    const auto received = event.getMessage();
    if (auto& message = received->message) {
      if constexpr (requires { message->source; }) {
        const Sender sender = sender_of(event);
        message->source = sender.source;
        if constexpr (requires { message->latched; }) message->latched = sender.latched;
      }
      handler_(std::move(*message));
    } else if (unreadable_++ == 0) {
      std::fprintf(stderr, "ROS: %s: dropping messages of %s that can't be read as %s\n", topic_.c_str(),
                   event.getPublisherName().c_str(), ros1_types<Message>().c_str());
    }
  }
  // A number for each process, the same on all topics: a node that connects again is known by its address, one that is
  // started again has its old name and another address. By connections, since two processes of a name may both speak.
  Sender sender_of(const Event& event) {
    const auto& connection = event.getConnectionHeaderPtr();
    const auto known = sources_.find(connection);
    if (known != sources_.end()) return {known->second};
    std::erase_if(sources_, [](const auto& one) { return one.first.use_count() == 1; });  // it has ended
    std::string& address = addresses_[event.getPublisherName()];
    if (const auto now = node_->answers() ? address_of_node(event.getPublisherName()) : std::nullopt) address = *now;
    const auto source = std::hash<std::string>()(event.getPublisherName() + " " + address);
    sources_.emplace(connection, source);
    const auto latching = connection->find("latching");
    const bool is_new = heard_.insert(source).second,
               latches = latching != connection->end() && latching->second == "1";
    return {source, !latches ? Latched::no : is_new ? Latched::perhaps : Latched::again};
  }
  // A publisher of another type refuses, of which roscpp says nothing.
  void look_for_other_types() {
    const std::string type = ros1_types<Message>();
    const auto other = node_->answers() ? other_type_on(subscriber_.getTopic(), type) : std::nullopt;
    connected_ = subscriber_.getNumPublishers() > 0;
    if (!other || connected_ || ++refused_ < 2) return;  // a connection takes its time
    connected_ = true;
    std::fprintf(stderr, "ROS: %s is %s, expected %s\n", topic_.c_str(), other->c_str(), type.c_str());
  }

  std::shared_ptr<Ros1Node> node_;
  std::string topic_;
  std::function<void(Message&&)> handler_;
  std::shared_ptr<ros::CallbackQueue> queue_ = std::make_shared<ros::CallbackQueue>();
  ros::Subscriber subscriber_;
  std::atomic<bool> ended_ = false;
  bool connected_ = false;  // or the reason was reported
  long unreadable_ = 0, refused_ = 0;
  // The thread's only: of connections, by their headers, which are kept so that none is taken for another; and where
  // nodes answer, as the master knew it last.
  std::map<boost::shared_ptr<ros::M_string>, std::uint64_t> sources_;
  std::map<std::string, std::string> addresses_;
  std::set<std::uint64_t> heard_;
  std::thread thread_;
};

}  // namespace lapservo::internal

namespace ros {
namespace message_traits {

template <typename Message>
struct MD5Sum<lapservo::internal::Ros1Received<Message>> {
  static const char* value() {
    if constexpr (lapservo::internal::is_of_any_type<Message>)
      return "*";
    else
      return md5sum<lapservo::internal::Ros1Type<Message>>();
  }
};

template <typename Message>
struct DataType<lapservo::internal::Ros1Received<Message>> {
  static const char* value() {
    if constexpr (lapservo::internal::is_of_any_type<Message>)
      return "*";
    else
      return datatype<lapservo::internal::Ros1Type<Message>>();
  }
};

}  // namespace message_traits

namespace serialization {

template <typename Message>
struct PreDeserialize<lapservo::internal::Ros1Received<Message>> {
  static void notify(const PreDeserializeParams<lapservo::internal::Ros1Received<Message>>& params) {
    if constexpr (std::is_same_v<Message, lapservo::internal::BoolMessage>)
      params.message->type = (*params.connection_header)["type"];
  }
};

template <typename Message>
struct Serializer<lapservo::internal::Ros1Received<Message>> {
  template <typename Stream>
  static void read(Stream& stream, lapservo::internal::Ros1Received<Message>& received) {
    using namespace lapservo::internal;
    const std::span<const std::uint8_t> bytes(stream.getData(), stream.getLength());
    if constexpr (std::is_same_v<Message, CommandMessage>) {
      received.message.emplace();
    } else if constexpr (!std::is_same_v<Message, BoolMessage>) {
      received.message = decode_ros1<Message>(bytes);
    } else if (received.type == message_traits::datatype<Ros1Type<BoolMessage>>()) {
      received.message = decode_ros1<BoolMessage>(bytes);
    } else if (received.type == message_traits::datatype<Ros1Type<JoyMessage>>()) {
      if (const auto joy = decode_ros1<JoyMessage>(bytes)) received.message = first_button(*joy);
    }
  }
};

}  // namespace serialization
}  // namespace ros
