#include "transports/ros1/ros1_decoder.h"

#include <utility>

#include "transports/message_fields.h"

namespace lapservo::internal {
namespace {

void in_order(MessageBytes& from, TrajectoryMessage& message) {
  from(message.names);
  for (auto count = from.number<std::uint32_t>(); count > 0 && from.is_whole(); --count) {
    TrajectoryMessage::Point& point = message.points.emplace_back();
    from(point.positions);
    for (int i = 0; i < 3; ++i) from.unused<double>();  // velocities, accelerations, effort
    point.time_s = from.number<std::int32_t>();
    point.time_s += 1e-9 * from.number<std::int32_t>();
  }
}

void in_order(MessageBytes& from, JoyMessage& message) {
  from.unused<float>();  // axes
  from(message.buttons);
}

void in_order(MessageBytes& from, OperatingStateMessage& message) {
  from(message.state);
  from(message.is_homed);
  from(message.is_busy);
}

void in_order(MessageBytes& from, StringMessage& message) {
  from(message.text);
}

void in_order(MessageBytes& from, TextMessage& message) {
  from(message.text);
}

void in_order(MessageBytes& from, BoolMessage& message) {
  from(message.value);
}

}  // namespace

template <typename Message>
std::optional<Message> decode_ros1(std::span<const std::uint8_t> bytes) {
  auto from = MessageBytes::of_ros1(bytes);
  Message message;
  if constexpr (requires { message.stamp_s; }) from.header(message);
  in_order(from, message);
  return from.is_all() ? std::optional(std::move(message)) : std::nullopt;
}

template std::optional<JointMessage> decode_ros1(std::span<const std::uint8_t>);
template std::optional<TrajectoryMessage> decode_ros1(std::span<const std::uint8_t>);
template std::optional<OperatingStateMessage> decode_ros1(std::span<const std::uint8_t>);
template std::optional<BoolMessage> decode_ros1(std::span<const std::uint8_t>);
template std::optional<JoyMessage> decode_ros1(std::span<const std::uint8_t>);
template std::optional<StringMessage> decode_ros1(std::span<const std::uint8_t>);
template std::optional<TextMessage> decode_ros1(std::span<const std::uint8_t>);
template std::optional<ImageMessage> decode_ros1(std::span<const std::uint8_t>);
template std::optional<PlaceMessage> decode_ros1(std::span<const std::uint8_t>);
template std::optional<CompressedImageMessage> decode_ros1(std::span<const std::uint8_t>);

}  // namespace lapservo::internal
