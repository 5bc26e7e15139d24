#pragma once

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>

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
  auto joint_publisher(const std::string& topic) { return opened<JointMessage>(topic); }
  auto operating_state_publisher(const std::string& topic) { return opened<OperatingStateMessage>(topic); }
  auto string_publisher(const std::string& topic) { return opened<StringMessage>(topic); }
  auto joy_publisher(const std::string& topic) { return opened<JoyMessage>(topic); }
  auto bool_publisher(const std::string& topic) { return opened<BoolMessage>(topic); }
  auto trajectory_publisher(const std::string& topic) { return opened<TrajectoryMessage>(topic); }
  auto image_publisher(const std::string& topic) { return opened<ImageMessage>(topic); }
  auto compressed_image_publisher(const std::string& topic) { return opened<CompressedImageMessage>(topic); }
  auto camera_info_publisher(const std::string& topic) { return opened<CameraInfoMessage>(topic); }
  auto pose_publisher(const std::string& topic) { return opened<PoseMessage>(topic); }
  auto place_publisher(const std::string& topic) { return opened<PlaceMessage>(topic); }
  auto transform_publisher(const std::string& topic) { return opened<TransformsMessage>(topic); }
  auto static_transform_publisher(const std::string& topic) { return opened<StaticTransformsMessage>(topic); }
  auto cylinder_publisher(const std::string& topic) { return opened<CylindersMessage>(topic); }
  auto diagnostic_publisher(const std::string& topic) { return opened<DiagnosticMessage>(topic); }
  auto observation_publisher(const std::string& topic) { return opened<ObservationMessage>(topic); }
  /// For servo_jp: only the newest setpoint is kept, for 50 ms, and none reaches a subscriber that came after it.
  virtual Publisher<JointMessage> set_point_publisher(const std::string& topic) = 0;

  /// Messages that this transport's own publishers sent are left out.
  Subscription subscribe_joints(const std::string& topic, Handler<JointMessage> take) { return listen(topic, take); }
  Subscription subscribe_operating_state(const std::string& topic, Handler<OperatingStateMessage> take) {
    return listen(topic, take);
  }
  Subscription subscribe_strings(const std::string& topic, Handler<StringMessage> take) { return listen(topic, take); }
  /// Whether a button is pressed: a std_msgs/Bool, or the first button of a sensor_msgs/Joy, by the publisher's type.
  Subscription subscribe_buttons(const std::string& topic, Handler<BoolMessage> take) { return listen(topic, take); }
  Subscription subscribe_trajectories(const std::string& topic, Handler<TrajectoryMessage> take) {
    return listen(topic, take);
  }
  Subscription subscribe_images(const std::string& topic, Handler<ImageMessage> take) { return listen(topic, take); }
  Subscription subscribe_compressed_images(const std::string& topic, Handler<CompressedImageMessage> take) {
    return listen(topic, take);
  }
  Subscription subscribe_places(const std::string& topic, Handler<PlaceMessage> take) { return listen(topic, take); }
  virtual Subscription subscribe_commands(const std::string& topic, CommandType type,
                                          Handler<CommandMessage> handler) = 0;

  /// The other nodes that read a topic of this transport's publishers, by their names, each once.
  virtual std::set<std::string> readers(const std::string& topic) const = 0;

  /// Topics that others publish now, by their types: {"/endoscope/image_raw", "sensor_msgs/msg/Image"}, in ROS 1
  /// "sensor_msgs/Image". Empty where the middleware does not answer.
  virtual std::map<std::string, std::string> published() const = 0;

  /// The time that stamps of messages to be sent carry: seconds since 1970.
  virtual double stamp_now_s() const = 0;

 protected:
  using AnyPublisher =
      std::variant<Publisher<JointMessage>, Publisher<OperatingStateMessage>, Publisher<StringMessage>,
                   Publisher<JoyMessage>, Publisher<BoolMessage>, Publisher<TrajectoryMessage>, Publisher<ImageMessage>,
                   Publisher<CompressedImageMessage>, Publisher<CameraInfoMessage>, Publisher<PoseMessage>,
                   Publisher<PlaceMessage>, Publisher<TransformsMessage>, Publisher<StaticTransformsMessage>,
                   Publisher<CylindersMessage>, Publisher<DiagnosticMessage>, Publisher<ObservationMessage>>;
  using AnyHandler = std::variant<Handler<JointMessage>, Handler<OperatingStateMessage>, Handler<StringMessage>,
                                  Handler<BoolMessage>, Handler<TrajectoryMessage>, Handler<ImageMessage>,
                                  Handler<CompressedImageMessage>, Handler<PlaceMessage>>;
  /// Whether the last message reaches subscribers that come later.
  template <typename Message>
  static constexpr bool is_latched =
      std::is_same_v<Message, OperatingStateMessage> || std::is_same_v<Message, StaticTransformsMessage>;
  template <typename Message>
  static constexpr bool is_image =
      std::is_same_v<Message, ImageMessage> || std::is_same_v<Message, CompressedImageMessage>;

 private:
  /// Makes the publisher that the variant holds one of this topic.
  virtual void open(const std::string& topic, AnyPublisher& publisher) = 0;
  virtual Subscription listen(const std::string& topic, const AnyHandler& handler) = 0;

  template <typename Message>
  Publisher<Message> opened(const std::string& topic) {
    AnyPublisher made = Publisher<Message>();
    open(topic, made);
    return std::get<Publisher<Message>>(std::move(made));
  }
};

}  // namespace lapservo::internal
