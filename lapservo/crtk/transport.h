#pragma once

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>

#include "lapservo/crtk/messages.h"

namespace lapservo::internal {

/// Carries messages by topic (ROS 2's wire, ROS 1, a test's memory). Handlers are called in the transport's threads,
/// one at a time for each topic, until the subscription that was returned is destroyed. Topics are names as in ROS, for
/// example /PSM1/measured_js.
class Transport {
 public:
  virtual ~Transport() = default;

  template <typename Message>
  using Publisher = std::function<void(const Message&)>;
  template <typename Message>
  using Handler = std::function<void(Message&&)>;
  /// Destroyed, no handler runs any more.
  using Subscription = std::shared_ptr<void>;

  /// Publishers may be called from every thread; a copy that lives keeps the topic alive.
  virtual Publisher<JointMessage> joint_publisher(const std::string& topic) = 0;
  /// For servo_jp: only the newest setpoint is kept, for 50 ms, and none reaches a subscriber that came after it.
  virtual Publisher<JointMessage> set_point_publisher(const std::string& topic) = 0;
  virtual Publisher<OperatingStateMessage> operating_state_publisher(const std::string& topic) = 0;
  virtual Publisher<StringMessage> string_publisher(const std::string& topic) = 0;
  virtual Publisher<JoyMessage> joy_publisher(const std::string& topic) = 0;
  virtual Publisher<BoolMessage> bool_publisher(const std::string& topic) = 0;
  virtual Publisher<TrajectoryMessage> trajectory_publisher(const std::string& topic) = 0;
  virtual Publisher<ImageMessage> image_publisher(const std::string& topic) = 0;
  virtual Publisher<CompressedImageMessage> compressed_image_publisher(const std::string& topic) = 0;
  virtual Publisher<CameraInfoMessage> camera_info_publisher(const std::string& topic) = 0;
  virtual Publisher<PoseMessage> pose_publisher(const std::string& topic) = 0;
  virtual Publisher<DiagnosticMessage> diagnostic_publisher(const std::string& topic) = 0;
  virtual Publisher<ObservationMessage> observation_publisher(const std::string& topic) = 0;

  /// Messages that this transport's own publishers sent are left out.
  virtual Subscription subscribe_joints(const std::string& topic, Handler<JointMessage> handler) = 0;
  virtual Subscription subscribe_operating_state(const std::string& topic, Handler<OperatingStateMessage> handler) = 0;
  virtual Subscription subscribe_strings(const std::string& topic, Handler<StringMessage> handler) = 0;
  /// Whether a button is pressed: a std_msgs/Bool, or the first button of a sensor_msgs/Joy, by the publisher's type.
  virtual Subscription subscribe_buttons(const std::string& topic, Handler<BoolMessage> handler) = 0;
  virtual Subscription subscribe_commands(const std::string& topic, CommandType type,
                                          Handler<CommandMessage> handler) = 0;
  virtual Subscription subscribe_trajectories(const std::string& topic, Handler<TrajectoryMessage> handler) = 0;
  virtual Subscription subscribe_images(const std::string& topic, Handler<ImageMessage> handler) = 0;
  virtual Subscription subscribe_compressed_images(const std::string& topic,
                                                   Handler<CompressedImageMessage> handler) = 0;

  /// The other nodes that read a topic of this transport's publishers, by their names, each once.
  virtual std::set<std::string> readers(const std::string& topic) const = 0;

  /// Topics that others publish now, by their types: {"/endoscope/image_raw", "sensor_msgs/msg/Image"}, in ROS 1
  /// "sensor_msgs/Image". Empty where the middleware does not answer.
  virtual std::map<std::string, std::string> published() const = 0;

  /// The time that stamps of messages to be sent carry: seconds since 1970.
  virtual double stamp_now_s() const = 0;
};

}  // namespace lapservo::internal
