#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "lapservo/crtk/transport.h"

namespace lapservo::internal {

/// Topics in memory: messages that are published are kept; handlers get what say() says, in the caller's thread.
class TestTransport : public Transport {
 public:
  using Topic = const std::string&;
  Publisher<JointMessage> joint_publisher(Topic topic) override { return keep(topic); }
  Publisher<JointMessage> set_point_publisher(Topic topic) override { return keep(topic); }
  Publisher<OperatingStateMessage> operating_state_publisher(Topic topic) override { return keep(topic); }
  Publisher<StringMessage> string_publisher(Topic topic) override { return keep(topic); }
  Publisher<JoyMessage> joy_publisher(Topic topic) override { return keep(topic); }
  Publisher<BoolMessage> bool_publisher(Topic topic) override { return keep(topic); }
  Publisher<TrajectoryMessage> trajectory_publisher(Topic topic) override { return keep(topic); }
  Publisher<ImageMessage> image_publisher(Topic topic) override { return keep(topic); }
  Publisher<CompressedImageMessage> compressed_image_publisher(Topic topic) override { return keep(topic); }
  Publisher<CameraInfoMessage> camera_info_publisher(Topic topic) override { return keep(topic); }

  Publisher<PoseMessage> pose_publisher(Topic topic) override { return keep(topic); }
  Publisher<DiagnosticMessage> diagnostic_publisher(Topic topic) override { return keep(topic); }
  Publisher<ObservationMessage> observation_publisher(Topic topic) override { return keep(topic); }

  Subscription subscribe_joints(Topic topic, Handler<JointMessage> handler) override { return add(topic, handler); }
  Subscription subscribe_operating_state(Topic topic, Handler<OperatingStateMessage> handler) override {
    return add(topic, handler);
  }
  Subscription subscribe_strings(Topic topic, Handler<StringMessage> handler) override { return add(topic, handler); }
  Subscription subscribe_buttons(Topic topic, Handler<BoolMessage> handler) override { return add(topic, handler); }
  Subscription subscribe_commands(Topic topic, CommandType, Handler<CommandMessage> handler) override {
    return add(topic, handler);
  }
  Subscription subscribe_trajectories(Topic topic, Handler<TrajectoryMessage> handler) override {
    return add(topic, handler);
  }
  Subscription subscribe_images(Topic topic, Handler<ImageMessage> handler) override { return add(topic, handler); }
  Subscription subscribe_compressed_images(Topic topic, Handler<CompressedImageMessage> handler) override {
    return add(topic, handler);
  }
  std::set<std::string> readers(const std::string&) const override { return readers_; }
  std::map<std::string, std::string> published() const override { return {}; }
  double stamp_now_s() const override { return stamp_s; }

  template <typename Message>
  void say(const std::string& topic, const Message& message) {
    for (const auto& weak : handlers<Message>()[topic])
      if (const auto handler = weak.lock()) (*handler)(Message(message));
  }
  /// All that was published.
  template <typename Message>
  std::vector<Message> sent(const std::string& topic) {
    const std::lock_guard lock(mutex_);
    return kept<Message>()[topic];
  }
  /// Says all that was published since the last call.
  void deliver() { deliver_all<JointMessage>(), deliver_all<OperatingStateMessage>(), deliver_all<ImageMessage>(); }

  /// Who reads, from now on.
  void let_read(std::set<std::string> readers) { readers_ = std::move(readers); }

  double stamp_s = 1000;

 private:
  template <typename Message>
  using Handlers = std::map<std::string, std::vector<std::weak_ptr<Handler<Message>>>>;
  template <typename Message>
  using Kept = std::map<std::string, std::vector<Message>>;

  template <typename Message>
  Handlers<Message>& handlers() {
    return std::get<Handlers<Message>>(handlers_);
  }
  template <typename Message>
  Kept<Message>& kept() {
    return std::get<Kept<Message>>(kept_);
  }
  struct Keeper {
    TestTransport* transport;
    std::string topic;
    template <typename Message>
    void operator()(const Message& message) const {
      const std::lock_guard lock(transport->mutex_);
      transport->kept<Message>()[topic].push_back(message);
    }
  };
  Keeper keep(const std::string& topic) { return {this, topic}; }
  template <typename Message>
  Subscription add(const std::string& topic, const Handler<Message>& handler) {
    auto shared = std::make_shared<Handler<Message>>(handler);
    handlers<Message>()[topic].push_back(shared);
    return shared;
  }
  template <typename Message>
  void deliver_all() {
    for (auto& [topic, messages] : std::exchange(kept<Message>(), {}))
      for (const auto& message : messages) say(topic, message);
  }

  std::mutex mutex_;
  std::set<std::string> readers_{"/arm"};
  std::tuple<Kept<JointMessage>, Kept<OperatingStateMessage>, Kept<StringMessage>, Kept<JoyMessage>, Kept<BoolMessage>,
             Kept<TrajectoryMessage>, Kept<ImageMessage>, Kept<CompressedImageMessage>, Kept<CameraInfoMessage>,
             Kept<PoseMessage>, Kept<DiagnosticMessage>, Kept<ObservationMessage>>
      kept_;
  std::tuple<Handlers<JointMessage>, Handlers<OperatingStateMessage>, Handlers<StringMessage>, Handlers<BoolMessage>,
             Handlers<CommandMessage>, Handlers<TrajectoryMessage>, Handlers<ImageMessage>,
             Handlers<CompressedImageMessage>>
      handlers_;
};

}  // namespace lapservo::internal
