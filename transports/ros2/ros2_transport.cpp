#include "transports/ros2/ros2_transport.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <functional>
#include <map>
#include <set>
#include <thread>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "lapservo/core/wall_clock.h"
#include "transports/ros2/dds_node.h"
#include "transports/ros2/ros2_names.h"
#include "transports/ros2/wire.h"

namespace lapservo::internal {
namespace {

std::uint32_t domain_of_environment() {
  const char* const id = std::getenv("ROS_DOMAIN_ID");
  return domain_id(id ? id : "");
}

// A writer's sample reaches readers of different QoS on separate ways: the first one counts. Its stamp identifies it,
// but not its order: a writer's clock may be set.
class Sieve {
 public:
  bool is_new(const dds_sample_info_t& info, dds_entity_t reader) {
    constexpr std::size_t remembered = 64;  // more than all readers hold
    auto& last = last_[info.publication_handle];
    for (const auto& [stamp, by] : last)
      if (stamp == info.source_timestamp && by != reader) return false;
    last.emplace_back(info.source_timestamp, reader);
    if (last.size() > remembered) last.pop_front();
    return true;
  }

 private:
  std::map<dds_instance_handle_t, std::deque<std::pair<dds_time_t, dds_entity_t>>> last_;
};

// Whether the reader has a publisher that keeps nothing for those who come later.
bool has_volatile_publisher(dds_entity_t reader) {
  std::array<dds_instance_handle_t, 16> writers{};
  const int count = dds_get_matched_publications(reader, writers.data(), writers.size());
  return std::any_of(writers.begin(), writers.begin() + std::clamp<int>(count, 0, writers.size()), [&](auto writer) {
    dds_builtintopic_endpoint_t* const endpoint = dds_get_matched_publication_data(reader, writer);
    if (!endpoint) return false;
    dds_durability_kind_t kind = DDS_DURABILITY_TRANSIENT_LOCAL;
    dds_qget_durability(endpoint->qos, &kind);
    dds_builtintopic_free_endpoint(endpoint);
    return kind == DDS_DURABILITY_VOLATILE;
  });
}

// DDS matches each reader with the publishers of its type.
std::vector<const dds_topic_descriptor_t*> types_of(CommandType command) {
  switch (command) {
    case CommandType::joints:
      return {&sensor_msgs_msg_dds__JointState__desc};
    case CommandType::pose:
      return {&geometry_msgs_msg_dds__PoseStamped__desc, &geometry_msgs_msg_dds__TransformStamped__desc};
    case CommandType::twist:
      return {&geometry_msgs_msg_dds__TwistStamped__desc};
    case CommandType::wrench:
      return {&geometry_msgs_msg_dds__WrenchStamped__desc};
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

// Readers of a topic with the thread that takes from them.
class Reading {
 public:
  using Taken = std::function<void(const void*, dds_instance_handle_t writer)>;
  Reading(std::shared_ptr<DdsNode> node, const std::string& topic, const dds_topic_descriptor_t& type,
          const std::vector<Delivery>& deliveries, Taken taken)
      : node_(std::move(node)),
        topic_(topic),
        taken_(std::move(taken)),
        awaited_(deliveries.front() == Delivery::latched),
        waitset_(dds_create_waitset(node_->participant())) {
    dds_waitset_attach(waitset_, waitset_, 0);
    for (const Delivery delivery : deliveries) {
      readers_.push_back(node_->create_reader(topic, type, delivery));
      const dds_entity_t condition = dds_create_readcondition(readers_.back(), DDS_ANY_STATE);
      dds_waitset_attach(waitset_, condition, 0);
    }
    thread_ = std::thread([this] { work(); });
  }
  ~Reading() {
    dds_waitset_set_trigger(waitset_, true);
    thread_.join();
    dds_delete(waitset_);
    for (const dds_entity_t reader : readers_) node_->remove(reader);
  }

 private:
  void work() {
    while (true) {
      const bool silent = dds_waitset_wait(waitset_, nullptr, 0, awaited_ ? patience : DDS_INFINITY) == 0;
      if (dds_triggered(waitset_) > 0) return;
      if (silent) look_for_silent_publisher();
      for (const dds_entity_t reader : readers_) take(reader);
    }
  }
  // A message that is sent once should reach later subscribers.
  void look_for_silent_publisher() {
    if (!has_volatile_publisher(readers_.back()) || ++silences_ < 2) return;  // the first may have just come
    awaited_ = false;
    std::fprintf(stderr,
                 "DDS: %s: its publisher is volatile and has said nothing since: let it say it again, or latch it "
                 "(transient local)\n",
                 topic_.c_str());
  }
  void take(dds_entity_t reader) {
    constexpr int at_once = 16;
    std::array<void*, at_once> samples{};
    std::array<dds_sample_info_t, at_once> infos;
    const int count = dds_take(reader, samples.data(), infos.data(), at_once, at_once);
    if (count <= 0) return;
    awaited_ = false;
    for (int i = 0; i < count; ++i)
      if (infos[i].valid_data && sieve_.is_new(infos[i], reader)) taken_(samples[i], infos[i].publication_handle);
    dds_return_loan(reader, samples.data(), count);
  }

  static constexpr dds_duration_t patience = DDS_SECS(1);

  std::shared_ptr<DdsNode> node_;
  std::string topic_;
  Taken taken_;
  bool awaited_;  // until the first message of a topic that is latched
  int silences_ = 0;
  dds_entity_t waitset_;
  std::vector<dds_entity_t> readers_;
  Sieve sieve_;
  std::thread thread_;
};

}  // namespace

class Ros2Transport::Implementation {
 public:
  explicit Implementation(const std::string& node_name)
      : node_(std::make_shared<DdsNode>(node_name, domain_of_environment())) {}

  std::map<std::string, std::string> published() const { return node_->published(); }

  std::set<std::string> readers(const std::string& topic) const { return node_->readers(topic); }

  template <typename Message>
  Publisher<Message> publisher(const std::string& topic, Delivery delivery) {
    const dds_entity_t writer = node_->create_writer(topic, Wire<Message>::descriptor(), delivery);
    const std::shared_ptr<void> end(nullptr, [node = node_, writer](void*) { node->remove(writer); });
    return [writer, end](const Message& message) { Wire<Message>::write(writer, message); };
  }

  template <typename Message>
  Subscription subscribe(const std::string& topic, const std::vector<Delivery>& deliveries,
                         const Handler<Message>& handler) {
    using Type = typename Wire<Message>::Type;
    const auto taken = [handler](const void* wire, dds_instance_handle_t writer) {
      Message message = Wire<Message>::read(*static_cast<const Type*>(wire));
      if constexpr (requires { message.source; }) message.source = writer;
      handler(std::move(message));
    };
    return std::make_shared<Reading>(node_, topic, Wire<Message>::descriptor(), deliveries, taken);
  }

  Subscription subscribe_commands(const std::string& topic, CommandType type, const Handler<CommandMessage>& handler) {
    const auto taken = [handler](const void*, dds_instance_handle_t) { handler(CommandMessage()); };
    auto readings = std::make_shared<std::vector<std::unique_ptr<Reading>>>();
    for (const dds_topic_descriptor_t* descriptor : types_of(type))
      readings->push_back(
          std::make_unique<Reading>(node_, topic, *descriptor, std::vector{Delivery::best_effort}, taken));
    return readings;
  }

 private:
  std::shared_ptr<DdsNode> node_;
};

Ros2Transport::Ros2Transport(const std::string& node_name)
    : implementation_(std::make_shared<Implementation>(node_name)) {}

Ros2Transport::~Ros2Transport() = default;

std::set<std::string> Ros2Transport::readers(const std::string& topic) const {
  return implementation_->readers(topic);
}

std::map<std::string, std::string> Ros2Transport::published() const {
  return implementation_->published();
}

double Ros2Transport::stamp_now_s() const {
  return since_1970_s();
}

void Ros2Transport::open(const std::string& topic, AnyPublisher& publisher) {
  const auto make = [&]<typename Message>(Publisher<Message>& one) {
    constexpr bool latched = std::is_same_v<Message, OperatingStateMessage>;
    one = implementation_->publisher<Message>(topic, latched             ? Delivery::latched
                                                     : is_image<Message> ? Delivery::best_effort
                                                                         : Delivery::reliable);
  };
  std::visit(make, publisher);
}

Transport::Publisher<JointMessage> Ros2Transport::set_point_publisher(const std::string& topic) {
  return implementation_->publisher<JointMessage>(topic, Delivery::set_point);
}

Transport::Subscription Ros2Transport::listen(const std::string& topic, const AnyHandler& handler) {
  const auto subscribe = [&]<typename Message>(const Handler<Message>& one) {
    return implementation_->subscribe<Message>(topic, deliveries_of<Message>(), one);
  };
  const auto* const buttons = std::get_if<Handler<BoolMessage>>(&handler);
  if (!buttons) return std::visit(subscribe, handler);
  const Handler<JoyMessage> joys = [take = *buttons](JoyMessage&& message) { take(first_button(message)); };
  return std::make_shared<std::pair<Subscription, Subscription>>(subscribe(*buttons), subscribe(joys));
}

Transport::Subscription Ros2Transport::subscribe_commands(const std::string& topic, CommandType type,
                                                          Handler<CommandMessage> handler) {
  return implementation_->subscribe_commands(topic, type, handler);
}

}  // namespace lapservo::internal
