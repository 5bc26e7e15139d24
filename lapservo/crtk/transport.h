#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>

#include "lapservo/core/wall_clock.h"
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
  template <typename Message>
  Publisher<Message> publisher(const std::string& topic) {
    AnyPublisher made = Publisher<Message>();
    open(topic, made);
    return std::get<Publisher<Message>>(std::move(made));
  }
  /// For servo_jp: only the newest setpoint is kept, for 50 ms, and none reaches a subscriber that came after it.
  virtual Publisher<JointMessage> set_point_publisher(const std::string& topic) = 0;

  /// Messages that this transport's own publishers sent are left out. A BoolMessage is whether a button is pressed: a
  /// std_msgs/Bool, or the first button of a sensor_msgs/Joy, by the publisher's type.
  template <typename Message>
  Subscription subscribe(const std::string& topic, Handler<Message> take) {
    return listen(topic, std::move(take));
  }
  virtual Subscription subscribe_commands(const std::string& topic, CommandType type,
                                          Handler<CommandMessage> handler) = 0;

  /// The other nodes that read a topic of this transport's publishers, by their names, each once.
  virtual std::set<std::string> readers(const std::string& topic) const = 0;

  /// Topics that others publish now, by their types: {"/endoscope/image_raw", "sensor_msgs/msg/Image"}, in ROS 1
  /// "sensor_msgs/Image". Empty where the middleware does not answer.
  virtual std::map<std::string, std::string> published() const = 0;

  /// The time that stamps of messages to be sent carry: seconds since 1970.
  virtual double stamp_now_s() const { return since_1970_s(); }

 protected:
  using AnyPublisher =
      std::variant<Publisher<JointMessage>, Publisher<OperatingStateMessage>, Publisher<StringMessage>,
                   Publisher<TextMessage>, Publisher<JoyMessage>, Publisher<BoolMessage>, Publisher<TrajectoryMessage>,
                   Publisher<ImageMessage>, Publisher<CompressedImageMessage>, Publisher<CameraInfoMessage>,
                   Publisher<PoseMessage>, Publisher<PlaceMessage>, Publisher<TransformsMessage>,
                   Publisher<StaticTransformsMessage>, Publisher<CylindersMessage>, Publisher<DiagnosticMessage>,
                   Publisher<ObservationMessage>>;
  using AnyHandler = std::variant<Handler<JointMessage>, Handler<OperatingStateMessage>, Handler<StringMessage>,
                                  Handler<TextMessage>, Handler<BoolMessage>, Handler<TrajectoryMessage>,
                                  Handler<ImageMessage>, Handler<CompressedImageMessage>, Handler<PlaceMessage>>;
  /// Whether the last message reaches subscribers that come later.
  template <typename Message>
  static constexpr bool is_latched =
      std::is_same_v<Message, OperatingStateMessage> || std::is_same_v<Message, StaticTransformsMessage>;
  template <typename Message>
  static constexpr bool is_image =
      std::is_same_v<Message, ImageMessage> || std::is_same_v<Message, CompressedImageMessage>;
  /// Messages of a topic that are kept until they are taken, of all its publishers: whoever floods it must not push
  /// another one's out. 30,000 texts a second take longer than 0.1 s to do so. nullopt: as many as usual.
  template <typename Message>
  static constexpr std::optional<std::uint32_t> depth = std::is_same_v<Message, StringMessage> ? std::optional(5000)
                                                        : std::is_same_v<Message, OperatingStateMessage>
                                                            ? std::optional(1000)
                                                            : std::nullopt;

 private:
  /// Makes the publisher that the variant holds one of this topic.
  virtual void open(const std::string& topic, AnyPublisher& publisher) = 0;
  virtual Subscription listen(const std::string& topic, const AnyHandler& handler) = 0;
};

}  // namespace lapservo::internal
