#include "transports/ros2/dds_node.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <stdexcept>
#include <type_traits>

#include <fmt/format.h>

#include "lapservo/core/environment.h"
#include "ros2_messages.h"
#include "transports/ros2/discovery.h"
#include "transports/ros2/ros2_names.h"

namespace lapservo::internal {
namespace {

dds_entity_t checked(dds_entity_t entity, const char* what) {
  if (entity < 0) throw std::runtime_error(std::string("DDS: ") + what + ": " + dds_strretcode(-entity));
  return entity;
}

template <auto end>
struct EndedBy {
  void operator()(auto* owned) const { end(owned); }
};
using Qos = std::unique_ptr<dds_qos_t, EndedBy<dds_delete_qos>>;
using Listener = std::unique_ptr<dds_listener_t, EndedBy<dds_delete_listener>>;

Qos qos_of(Delivery delivery) {
  Qos qos(dds_create_qos());
  const bool reliable = delivery != Delivery::best_effort;
  dds_qset_reliability(qos.get(), reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, DDS_MSECS(100));
  dds_qset_durability(qos.get(),
                      delivery == Delivery::latched ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  const int depth = delivery == Delivery::reliable ? 10 : delivery == Delivery::best_effort ? 5 : 1;
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, depth);
  // Without it what a dead arm has not acknowledged goes to the one that is started in its place.
  if (delivery == Delivery::set_point) dds_qset_lifespan(qos.get(), DDS_MSECS(50));
  const dds_data_representation_id_t xcdr1 = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(qos.get(), 1, &xcdr1);
  return qos;
}

const char* text_of(std::uint32_t policy) {
  switch (policy) {
    case DDS_RELIABILITY_QOS_POLICY_ID:
      return "reliability";
    case DDS_DURABILITY_QOS_POLICY_ID:
      return "durability";
    case DDS_DATA_REPRESENTATION_QOS_POLICY_ID:
      return "data representation";
    default:
      return "quality of service";
  }
}

// Called by DDS with the topic's name; once a topic.
void say_offered(dds_entity_t, dds_offered_incompatible_qos_status_t status, void* topic) {
  if (status.total_count > 1) return;
  std::fprintf(stderr, "DDS: %s: a subscriber requires another %s than is offered, and gets nothing%s\n",
               static_cast<const std::string*>(topic)->c_str(), text_of(status.last_policy_id),
               status.last_policy_id == DDS_RELIABILITY_QOS_POLICY_ID ? ": let it read best effort" : "");
}

void say_requested(dds_entity_t, dds_requested_incompatible_qos_status_t status, void* topic) {
  if (status.total_count > 1) return;
  std::fprintf(stderr, "DDS: %s: a publisher offers another %s than can be read, and is not heard\n",
               static_cast<const std::string*>(topic)->c_str(), text_of(status.last_policy_id));
}

// CYCLONEDDS_URI comes last and overrides the rest.
std::string configuration() {
  const Discovery discovery = discovery_of(
      environment("ROS_LOCALHOST_ONLY"), environment("ROS_AUTOMATIC_DISCOVERY_RANGE"), environment("ROS_STATIC_PEERS"));
  const std::string own = environment("CYCLONEDDS_URI");
  return cyclone_configuration(discovery, has_network()) + (own.empty() ? "" : "," + own);
}

// Errors, and warnings that have a remedy, which are given once.
void log_sink(void*, const dds_log_data_t* data) {
  const std::string text(data->message, data->size);
  static std::atomic<bool> remedied = false;
  if (data->priority & (DDS_LC_ERROR | DDS_LC_FATAL)) {
    std::fprintf(stderr, "DDS: %s\n", text.c_str());
  } else if (const auto remedy = remedy_of_warning(text); remedy && !remedied.exchange(true)) {
    std::fprintf(stderr, "DDS: %s: %s\n", text.c_str(), remedy->c_str());
  }
}

// One a process and number, configured before its first participant.
class Domains {
 public:
  ~Domains() {
    for (const auto& [id, domain] : domains_) dds_delete(domain);
  }
  void need(std::uint32_t id) {
    const std::lock_guard lock(mutex_);
    if (domains_.empty()) dds_set_log_sink(log_sink, nullptr);
    if (!domains_.count(id))
      domains_[id] = checked(dds_create_domain(id, configuration().c_str()), "domain (see CYCLONEDDS_URI)");
  }

 private:
  std::mutex mutex_;
  std::map<std::uint32_t, dds_entity_t> domains_;
};

dds_entity_t create_participant(std::uint32_t domain) {
  static Domains domains;
  domains.need(domain);
  const Qos qos(dds_create_qos());
  const std::string enclave = "enclave=/;";  // without it ROS 2 takes the participant for none of its own
  dds_qset_userdata(qos.get(), enclave.data(), enclave.size());
  return checked(dds_create_participant(domain, qos.get(), nullptr), "participant");
}

// Up to Humble a Gid had 24 bytes: WideInfo.
bool has_wide_gids() {
  const std::string name = environment("ROS_DISTRO");
  return name == "humble" || name == "galactic" || name == "foxy";
}

using Info = rmw_dds_common_msg_dds__ParticipantEntitiesInfo_;
using WideInfo = rmw_dds_common_humble_msg_dds__ParticipantEntitiesInfo_;

template <typename AnyInfo>
void write_announcement(dds_entity_t writer, const std::string& name, dds_entity_t participant,
                        const std::vector<dds_entity_t>& readers, const std::vector<dds_entity_t>& writers) {
  AnyInfo info{};
  std::decay_t<decltype(*info.node_entities_info_seq._buffer)> node{};
  const auto put_gid = [](dds_entity_t entity, auto& to) {
    dds_guid_t guid{};
    dds_get_guid(entity, &guid);
    std::memcpy(to.data, guid.v, sizeof guid.v);
  };
  const auto put_gids = [&](const std::vector<dds_entity_t>& entities, auto& to, auto& kept) {
    kept.resize(entities.size());
    for (std::size_t i = 0; i < entities.size(); ++i) put_gid(entities[i], kept[i]);
    to._length = to._maximum = static_cast<std::uint32_t>(kept.size());
    to._buffer = kept.data();
  };
  std::vector<decltype(info.gid)> reader_gids, writer_gids;
  put_gids(readers, node.reader_gid_seq, reader_gids);
  put_gids(writers, node.writer_gid_seq, writer_gids);
  node.node_namespace[0] = '/';
  name.copy(node.node_name, sizeof node.node_name - 1);
  put_gid(participant, info.gid);
  info.node_entities_info_seq._length = info.node_entities_info_seq._maximum = 1;
  info.node_entities_info_seq._buffer = &node;
  dds_write(writer, &info);
}

// All that a reader has, one after the other.
template <typename Sample>
void take_all(dds_entity_t reader, const auto& take) {
  constexpr int at_once = 64;
  std::array<void*, at_once> samples{};
  std::array<dds_sample_info_t, at_once> infos;
  for (int count; (count = dds_take(reader, samples.data(), infos.data(), at_once, at_once)) > 0;) {
    for (int i = 0; i < count; ++i)
      if (infos[i].valid_data) take(*static_cast<const Sample*>(samples[i]));
    dds_return_loan(reader, samples.data(), count);
  }
}

dds_topic_descriptor_t announcement_type(bool wide_gids) {
  dds_topic_descriptor_t type = wide_gids ? rmw_dds_common_humble_msg_dds__ParticipantEntitiesInfo__desc
                                          : rmw_dds_common_msg_dds__ParticipantEntitiesInfo__desc;
  type.m_typename = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";
  return type;
}

}  // namespace

// The nodes of readers, as participants announce them.
class NodeNames {
 public:
  NodeNames(dds_entity_t participant, dds_entity_t topic, bool wide_gids) : wide_gids_(wide_gids) {
    const Qos qos = qos_of(Delivery::latched);
    dds_qset_history(qos.get(), DDS_HISTORY_KEEP_ALL, DDS_LENGTH_UNLIMITED);  // all participants write one instance
    reader_ = checked(dds_create_reader(participant, topic, qos.get(), nullptr), "reader");
  }
  std::string of(const dds_builtintopic_endpoint_t& reader) {
    const auto note = [this](const auto& info) { this->note(info); };
    wide_gids_ ? take_all<WideInfo>(reader_, note) : take_all<Info>(reader_, note);
    const Id id = id_of(reader.key.v);
    const auto& names = names_[id_of(reader.participant_key.v)];
    const auto name = names.find(id);
    return name != names.end() ? name->second : program_of(id);
  }

 private:
  using Id = std::array<std::uint8_t, sizeof(dds_guid_t)>;
  static Id id_of(const std::uint8_t* bytes) {
    Id id;
    std::copy_n(bytes, id.size(), id.begin());
    return id;
  }
  // By what begins the GUID: the participant, or, where Fast DDS has vendor, computer and then process, the computer.
  static std::string program_of(const Id& guid) {
    const bool is_fast_dds = guid[0] == 0x01 && guid[1] == 0x0f;
    return fmt::format("{:02x}", fmt::join(guid.begin(), guid.begin() + (is_fast_dds ? 4 : 12), ""));
  }
  void note(const auto& info) {
    auto& names = names_[id_of(info.gid.data)];
    names.clear();
    for (std::uint32_t i = 0; i < info.node_entities_info_seq._length; ++i) {
      const auto& node = info.node_entities_info_seq._buffer[i];
      std::string name = node.node_namespace;
      if (!name.ends_with('/')) name += '/';
      name += node.node_name;
      for (std::uint32_t k = 0; k < node.reader_gid_seq._length; ++k)
        names[id_of(node.reader_gid_seq._buffer[k].data)] = name;
    }
  }

  bool wide_gids_;
  dds_entity_t reader_;
  std::map<Id, std::map<Id, std::string>> names_;  // of readers, by their participant
};

DdsNode::DdsNode(const std::string& node_name, std::uint32_t domain)
    : name_(node_name), participant_(create_participant(domain)), wide_gids_(has_wide_gids()) {
  const dds_entity_t topic = create_topic("ros_discovery_info", announcement_type(wide_gids_));
  discovery_ = checked(dds_create_writer(participant_, topic, qos_of(Delivery::latched).get(), nullptr), "writer");
  announce();
}

DdsNode::~DdsNode() {
  dds_delete(participant_);
}

dds_entity_t DdsNode::create_topic(const std::string& dds_name, const dds_topic_descriptor_t& type) {
  return checked(dds_create_topic(participant_, &type, dds_name.c_str(), nullptr, nullptr), "topic");
}

dds_entity_t DdsNode::create_writer(const std::string& topic, const dds_topic_descriptor_t& type, Delivery delivery) {
  const dds_entity_t on = create_topic(dds_topic_name(topic), type);
  const std::lock_guard lock(mutex_);
  const Listener listener(dds_create_listener(&topics_.emplace_back(topic)));
  dds_lset_offered_incompatible_qos(listener.get(), say_offered);
  const dds_entity_t writer =
      checked(dds_create_writer(participant_, on, qos_of(delivery).get(), listener.get()), "writer");
  dds_delete(on);  // the writer keeps it
  writers_.push_back(writer);
  writers_of_.emplace(dds_topic_name(topic), writer);
  announce();
  return writer;
}

dds_entity_t DdsNode::create_reader(const std::string& topic, const dds_topic_descriptor_t& type, Delivery delivery,
                                    std::optional<int> depth) {
  const Qos qos = qos_of(delivery);
  if (depth) dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, *depth);
  dds_qset_ignorelocal(qos.get(), DDS_IGNORELOCAL_PARTICIPANT);
  const dds_entity_t on = create_topic(dds_topic_name(topic), type);
  const std::lock_guard lock(mutex_);
  const Listener listener(dds_create_listener(&topics_.emplace_back(topic)));
  // Every topic has a best-effort reader, which matches all that can be read.
  if (delivery == Delivery::best_effort) dds_lset_requested_incompatible_qos(listener.get(), say_requested);
  const dds_entity_t reader = checked(dds_create_reader(participant_, on, qos.get(), listener.get()), "reader");
  dds_delete(on);
  readers_.push_back(reader);
  announce();
  return reader;
}

void DdsNode::remove(dds_entity_t entity) {
  const std::lock_guard lock(mutex_);
  for (auto* list : {&readers_, &writers_}) list->erase(std::remove(list->begin(), list->end(), entity), list->end());
  std::erase_if(writers_of_, [&](const auto& writer) { return writer.second == entity; });
  announce();
  dds_delete(entity);
}

std::set<std::string> DdsNode::readers(const std::string& topic) {
  const std::lock_guard lock(mutex_);
  if (!names_)
    names_ = std::make_unique<NodeNames>(participant_,
                                         create_topic("ros_discovery_info", announcement_type(wide_gids_)), wide_gids_);
  std::set<std::string> readers;
  const auto [begin, end] = writers_of_.equal_range(dds_topic_name(topic));
  for (auto writer = begin; writer != end; ++writer) {
    std::array<dds_instance_handle_t, 64> matched{};
    const int count = dds_get_matched_subscriptions(writer->second, matched.data(), matched.size());
    for (int i = 0; i < std::min<int>(count, matched.size()); ++i) {
      dds_builtintopic_endpoint_t* const reader = dds_get_matched_subscription_data(writer->second, matched[i]);
      if (!reader) continue;
      readers.insert(names_->of(*reader));
      dds_builtintopic_free_endpoint(reader);
    }
  }
  return readers;
}

std::map<std::string, std::string> DdsNode::published() const {
  dds_guid_t own{};
  dds_get_guid(participant_, &own);
  const dds_entity_t reader =
      checked(dds_create_reader(participant_, DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr), "reader");
  std::map<std::string, std::string> published;
  take_all<dds_builtintopic_endpoint_t>(reader, [&](const dds_builtintopic_endpoint_t& writer) {
    if (std::memcmp(writer.participant_key.v, own.v, sizeof own.v) == 0) return;
    if (const auto topic = ros2_topic_name(writer.topic_name)) published[*topic] = ros2_type_name(writer.type_name);
  });
  dds_delete(reader);
  return published;
}

void DdsNode::announce() {
  const auto write = wide_gids_ ? write_announcement<WideInfo> : write_announcement<Info>;
  write(discovery_, name_, participant_, readers_, writers_);
}

}  // namespace lapservo::internal
