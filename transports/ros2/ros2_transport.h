#pragma once

#include <map>
#include <memory>
#include <set>
#include <string>

#include "lapservo/crtk/transport.h"

namespace lapservo::internal {

/// The ROS 2 wire: topics, types and QoS as ROS 2's nodes have them, in the domain of ROS_DOMAIN_ID. Joint states,
/// setpoints and images are read best effort and operating states and strings by whatever is offered, so that every
/// publisher matches. Throws InputError for a topic or a domain that is none, std::runtime_error when DDS fails.
class Ros2Transport : public Transport {
 public:
  explicit Ros2Transport(const std::string& node_name);
  ~Ros2Transport() override;

  Publisher<JointMessage> joint_publisher(const std::string& topic) override;
  Publisher<JointMessage> set_point_publisher(const std::string& topic) override;
  Publisher<OperatingStateMessage> operating_state_publisher(const std::string& topic) override;
  Publisher<StringMessage> string_publisher(const std::string& topic) override;
  Publisher<JoyMessage> joy_publisher(const std::string& topic) override;
  Publisher<BoolMessage> bool_publisher(const std::string& topic) override;
  Publisher<TrajectoryMessage> trajectory_publisher(const std::string& topic) override;
  Publisher<ImageMessage> image_publisher(const std::string& topic) override;
  Publisher<CompressedImageMessage> compressed_image_publisher(const std::string& topic) override;
  Publisher<CameraInfoMessage> camera_info_publisher(const std::string& topic) override;
  Publisher<PoseMessage> pose_publisher(const std::string& topic) override;
  Publisher<DiagnosticMessage> diagnostic_publisher(const std::string& topic) override;
  Publisher<ObservationMessage> observation_publisher(const std::string& topic) override;

  Subscription subscribe_joints(const std::string& topic, Handler<JointMessage> handler) override;
  Subscription subscribe_operating_state(const std::string& topic, Handler<OperatingStateMessage> handler) override;
  Subscription subscribe_strings(const std::string& topic, Handler<StringMessage> handler) override;
  Subscription subscribe_buttons(const std::string& topic, Handler<BoolMessage> handler) override;
  Subscription subscribe_commands(const std::string& topic, CommandType type, Handler<CommandMessage> handler) override;
  Subscription subscribe_trajectories(const std::string& topic, Handler<TrajectoryMessage> handler) override;
  Subscription subscribe_images(const std::string& topic, Handler<ImageMessage> handler) override;
  Subscription subscribe_compressed_images(const std::string& topic, Handler<CompressedImageMessage> handler) override;

  std::set<std::string> readers(const std::string& topic) const override;
  std::map<std::string, std::string> published() const override;
  double stamp_now_s() const override;

 private:
  class Implementation;
  std::shared_ptr<Implementation> implementation_;  // publishers and subscriptions keep it
};

}  // namespace lapservo::internal
