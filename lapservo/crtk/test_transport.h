#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "lapservo/crtk/transport.h"

namespace lapservo::internal {

/// Topics in memory: what is published is kept; what say() says, handlers get, in the caller's thread.
class TestTransport : public Transport {
 public:
  Publisher<JointMessage> joint_publisher(const std::string& topic) override { return keep(topic, joints_); }
  Publisher<JointMessage> set_point_publisher(const std::string& topic) override { return keep(topic, joints_); }
  Publisher<OperatingStateMessage> operating_state_publisher(const std::string& topic) override {
    return keep(topic, states_);
  }
  Publisher<StringMessage> string_publisher(const std::string& topic) override { return keep(topic, strings_); }
  Publisher<JoyMessage> joy_publisher(const std::string& topic) override { return keep(topic, joys_); }
  Publisher<BoolMessage> bool_publisher(const std::string& topic) override { return keep(topic, bools_); }
  Publisher<TrajectoryMessage> trajectory_publisher(const std::string& topic) override {
    return keep(topic, trajectories_);
  }
  Publisher<ImageMessage> image_publisher(const std::string& topic) override { return keep(topic, images_); }
  Publisher<CompressedImageMessage> compressed_image_publisher(const std::string& topic) override {
    return keep(topic, compressed_);
  }
  Publisher<CameraInfoMessage> camera_info_publisher(const std::string& topic) override { return keep(topic, infos_); }

  Publisher<PoseMessage> pose_publisher(const std::string& topic) override { return keep(topic, poses_); }
  Publisher<DiagnosticMessage> diagnostic_publisher(const std::string& topic) override {
    return keep(topic, diagnostics_);
  }
  Publisher<ObservationMessage> observation_publisher(const std::string& topic) override {
    return keep(topic, observations_);
  }

  Subscription subscribe_joints(const std::string& topic, Handler<JointMessage> handler) override {
    return add(joint_handlers_[topic], std::move(handler));
  }
  Subscription subscribe_operating_state(const std::string& topic, Handler<OperatingStateMessage> handler) override {
    return add(state_handlers_[topic], std::move(handler));
  }
  Subscription subscribe_strings(const std::string& topic, Handler<StringMessage> handler) override {
    return add(string_handlers_[topic], std::move(handler));
  }
  Subscription subscribe_buttons(const std::string& topic, Handler<BoolMessage> handler) override {
    return add(button_handlers_[topic], std::move(handler));
  }
  Subscription subscribe_commands(const std::string& topic, CommandType, Handler<CommandMessage> handler) override {
    return add(command_handlers_[topic], std::move(handler));
  }
  Subscription subscribe_trajectories(const std::string& topic, Handler<TrajectoryMessage> handler) override {
    return add(trajectory_handlers_[topic], std::move(handler));
  }
  Subscription subscribe_images(const std::string& topic, Handler<ImageMessage> handler) override {
    return add(image_handlers_[topic], std::move(handler));
  }
  Subscription subscribe_compressed_images(const std::string& topic, Handler<CompressedImageMessage> handler) override {
    return add(compressed_handlers_[topic], std::move(handler));
  }
  std::set<std::string> readers(const std::string&) const override { return readers_; }
  std::map<std::string, std::string> published() const override { return {}; }
  double stamp_now_s() const override { return stamp_s; }

  void say(const std::string& topic, const JointMessage& message) { tell(joint_handlers_[topic], message); }
  void say(const std::string& topic, const OperatingStateMessage& message) { tell(state_handlers_[topic], message); }
  void say(const std::string& topic, const StringMessage& message) { tell(string_handlers_[topic], message); }
  void say(const std::string& topic, const BoolMessage& message) { tell(button_handlers_[topic], message); }
  void say(const std::string& topic, const CommandMessage& message) { tell(command_handlers_[topic], message); }
  void say(const std::string& topic, const TrajectoryMessage& message) { tell(trajectory_handlers_[topic], message); }
  std::vector<PoseMessage> poses(const std::string& topic) { return poses_[topic]; }
  std::vector<DiagnosticMessage> diagnostics(const std::string& topic) { return diagnostics_[topic]; }
  std::vector<ObservationMessage> observations(const std::string& topic) { return observations_[topic]; }
  std::vector<CompressedImageMessage> compressed_images(const std::string& topic) {
    const std::lock_guard lock(mutex_);
    return compressed_[topic];
  }
  /// Says all that was published since the last call.
  void deliver() {
    for (auto& [topic, messages] : std::exchange(joints_, {}))
      for (const auto& message : messages) tell(joint_handlers_[topic], message);
    for (auto& [topic, messages] : std::exchange(states_, {}))
      for (const auto& message : messages) tell(state_handlers_[topic], message);
    for (auto& [topic, messages] : std::exchange(images_, {}))
      for (const auto& message : messages) tell(image_handlers_[topic], message);
  }

  /// Who reads, from now on.
  void let_read(std::set<std::string> readers) { readers_ = std::move(readers); }

  double stamp_s = 1000;

  std::vector<JointMessage> joints(const std::string& topic) {
    const std::lock_guard lock(mutex_);
    return joints_[topic];
  }

 private:
  template <typename Message>
  using Handlers = std::vector<std::weak_ptr<Handler<Message>>>;

  template <typename Message>
  Publisher<Message> keep(const std::string& topic, std::map<std::string, std::vector<Message>>& kept) {
    return [this, topic, &kept](const Message& message) {
      const std::lock_guard lock(mutex_);
      kept[topic].push_back(message);
    };
  }
  template <typename Message>
  Subscription add(Handlers<Message>& handlers, Handler<Message> handler) {
    auto shared = std::make_shared<Handler<Message>>(std::move(handler));
    handlers.push_back(shared);
    return shared;
  }
  template <typename Message>
  void tell(const Handlers<Message>& handlers, const Message& message) {
    for (const auto& weak : handlers)
      if (const auto handler = weak.lock()) (*handler)(Message(message));
  }

  std::mutex mutex_;
  std::set<std::string> readers_{"/arm"};
  std::map<std::string, std::vector<JointMessage>> joints_;
  std::map<std::string, std::vector<OperatingStateMessage>> states_;
  std::map<std::string, std::vector<StringMessage>> strings_;
  std::map<std::string, std::vector<JoyMessage>> joys_;
  std::map<std::string, std::vector<BoolMessage>> bools_;
  std::map<std::string, std::vector<TrajectoryMessage>> trajectories_;
  std::map<std::string, std::vector<ImageMessage>> images_;
  std::map<std::string, std::vector<CompressedImageMessage>> compressed_;
  std::map<std::string, std::vector<CameraInfoMessage>> infos_;
  std::map<std::string, std::vector<PoseMessage>> poses_;
  std::map<std::string, std::vector<DiagnosticMessage>> diagnostics_;
  std::map<std::string, std::vector<ObservationMessage>> observations_;
  std::map<std::string, Handlers<JointMessage>> joint_handlers_;
  std::map<std::string, Handlers<OperatingStateMessage>> state_handlers_;
  std::map<std::string, Handlers<StringMessage>> string_handlers_;
  std::map<std::string, Handlers<BoolMessage>> button_handlers_;
  std::map<std::string, Handlers<CommandMessage>> command_handlers_;
  std::map<std::string, Handlers<TrajectoryMessage>> trajectory_handlers_;
  std::map<std::string, Handlers<ImageMessage>> image_handlers_;
  std::map<std::string, Handlers<CompressedImageMessage>> compressed_handlers_;
};

}  // namespace lapservo::internal
