#pragma once

#include <cstdint>
#include <dds/dds.h>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace lapservo::internal {

/// How a topic's messages are kept and passed on: ROS 2's profiles.
enum class Delivery {
  reliable,     ///< the default: reliable, volatile, the last 10
  best_effort,  ///< sensor data: best effort, volatile, the last 5
  latched,      ///< reliable, transient local, the last 1
  set_point,    ///< reliable, volatile, the last 1, void after 50 ms
};

class NodeNames;

/// A DDS participant that ROS 2's tools list as a node: each reader and writer is announced on ros_discovery_info.
/// Errors of the middleware are std::runtime_error. Peers whose QoS or types don't fit are said on stderr, once a
/// topic.
class DdsNode {
 public:
  DdsNode(const std::string& node_name, std::uint32_t domain);
  ~DdsNode();

  /// `topic` as in ROS.
  dds_entity_t create_writer(const std::string& topic, const dds_topic_descriptor_t& type, Delivery delivery);
  /// Without what this node's own writers send. `depth`: messages that it keeps until they are taken, of all writers;
  /// without it as many as its delivery says.
  dds_entity_t create_reader(const std::string& topic, const dds_topic_descriptor_t& type, Delivery delivery,
                             std::optional<int> depth = std::nullopt);
  /// Statistics of a reader or writer.
  void remove(dds_entity_t entity);

  /// Nodes of other participants that read what this one writes on a topic, each once, as in ROS; programs that are no
  /// nodes by the beginning of their GUID. A killed node stays for up to 20 s and counts once with its successor.
  std::set<std::string> readers(const std::string& topic);

  /// Topics that other participants write, by their types; both as in ROS.
  std::map<std::string, std::string> published() const;

  dds_entity_t participant() const { return participant_; }

 private:
  dds_entity_t create_topic(const std::string& dds_name, const dds_topic_descriptor_t& type);
  void announce();

  std::string name_;
  dds_entity_t participant_ = 0, discovery_ = 0;
  bool wide_gids_ = false;
  std::mutex mutex_;
  std::vector<dds_entity_t> readers_, writers_;
  std::multimap<std::string, dds_entity_t> writers_of_;  // by topic, as in DDS
  std::unique_ptr<NodeNames> names_;                     // once needed
  std::deque<std::string> topics_;                       // as their listeners name them
};

}  // namespace lapservo::internal
