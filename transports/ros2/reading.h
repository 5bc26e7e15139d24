#pragma once

#include <cstddef>
#include <dds/dds.h>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "transports/ros2/dds_node.h"

namespace lapservo::internal {

/// Readers of a topic, and the thread that takes from them. Each message is taken once, and those of a writer in the
/// order in which it wrote them.
class Reading {
 public:
  /// `program`: the participant that wrote it, the same on all topics; where its writer is gone by then a number of its
  /// own.
  using Taken = std::function<void(const void*, dds_instance_handle_t program)>;
  /// A reader for each delivery, the most demanding first. `depth`: as in DdsNode::create_reader(), for each.
  Reading(std::shared_ptr<DdsNode> node, const std::string& topic, const dds_topic_descriptor_t& type,
          const std::vector<Delivery>& deliveries, std::optional<int> depth, Taken taken);
  ~Reading();
  Reading(const Reading&) = delete;
  Reading& operator=(const Reading&) = delete;

 private:
  struct Writer {
    std::size_t reader;  // that counts, of readers_
    dds_instance_handle_t program;
  };
  void work();
  void look_for_silent_publisher();
  void take(std::size_t reader);
  const Writer& known(std::size_t reader, dds_instance_handle_t writer);

  std::shared_ptr<DdsNode> node_;
  std::string topic_;
  std::vector<Delivery> deliveries_;
  Taken taken_;
  bool awaited_;  // until the first message of a topic that is latched
  int silences_ = 0;
  dds_entity_t waitset_;
  std::vector<dds_entity_t> readers_;  // by deliveries_
  std::map<dds_instance_handle_t, Writer> writers_;
  std::thread thread_;
};

}  // namespace lapservo::internal
