#include "transports/ros1/ros1_decoder.h"

#include <bit>
#include <cstring>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "transports/message_fields.h"

namespace lapservo::internal {
namespace {

static_assert(std::endian::native == std::endian::little, "ROS 1 is little-endian, and so is what is copied here");

// Takes values from the front. After the first that isn't there, all are zero and whole() is false.
class Bytes {
 public:
  explicit Bytes(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  template <typename T>
  T number() {
    T value{};
    if (const auto bytes = take(1, sizeof value); bytes.size() == sizeof value)
      std::memcpy(&value, bytes.data(), sizeof value);
    return value;
  }
  std::string text() {
    const auto bytes = take(number<std::uint32_t>(), 1);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  template <typename T>
  std::vector<T> numbers() {
    const auto bytes = take(number<std::uint32_t>(), sizeof(T));
    std::vector<T> values(bytes.size() / sizeof(T));
    if (!values.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
    return values;
  }
  std::vector<std::string> texts() {
    std::vector<std::string> values;
    for (auto count = number<std::uint32_t>(); count > 0 && whole_; --count) values.push_back(text());
    return values;
  }
  /// The stamp of a std_msgs/Header.
  double stamp_s() {
    number<std::uint32_t>();  // seq
    const auto sec = number<std::uint32_t>(), nsec = number<std::uint32_t>();
    text();  // frame_id
    return nsec < 1000000000u ? sec + 1e-9 * nsec : std::numeric_limits<double>::quiet_NaN();
  }
  bool whole() const { return whole_; }
  bool is_all() const { return whole_ && rest_.empty(); }

 private:
  std::span<const std::uint8_t> take(std::uint64_t count, std::uint64_t size) {
    if (count * size > rest_.size()) {
      whole_ = false;
      rest_ = {};
    }
    const auto taken = rest_.first(whole_ ? count * size : 0);
    rest_ = rest_.subspan(taken.size());
    return taken;
  }

  std::span<const std::uint8_t> rest_;
  bool whole_ = true;
};

void read_fields(Bytes& from, TrajectoryMessage& message) {
  message.names = from.texts();
  for (auto count = from.number<std::uint32_t>(); count > 0 && from.whole(); --count) {
    TrajectoryMessage::Point point;
    point.positions = from.numbers<double>();
    for (int i = 0; i < 3; ++i) from.numbers<double>();  // velocities, accelerations, effort
    point.time_s = from.number<std::int32_t>();
    point.time_s += 1e-9 * from.number<std::int32_t>();
    message.points.push_back(std::move(point));
  }
}

void read_fields(Bytes& from, JoyMessage& message) {
  from.numbers<float>();  // axes
  message.buttons = from.numbers<std::int32_t>();
}

void read_fields(Bytes& from, OperatingStateMessage& message) {
  message.state = from.text();
  message.is_homed = from.number<std::uint8_t>() != 0;
  message.is_busy = from.number<std::uint8_t>() != 0;
}

void read_fields(Bytes& from, PlaceMessage& message) {
  for (double& value : message.pose.translation) value = from.number<double>();
  for (double& value : message.pose.rotation.coeffs()) value = from.number<double>();  // x, y, z, w
}

void read_fields(Bytes& from, StringMessage& message) {
  message.text = from.text();
}

}  // namespace

template <typename Message>
std::optional<Message> decode_ros1(std::span<const std::uint8_t> bytes) {
  Bytes from(bytes);
  Message message;
  message.stamp_s = from.stamp_s();
  read_fields(from, message);
  if (!from.is_all()) return std::nullopt;
  return message;
}

template <>
std::optional<BoolMessage> decode_ros1(std::span<const std::uint8_t> bytes) {
  Bytes from(bytes);
  const BoolMessage message{from.number<std::uint8_t>() != 0};
  return from.is_all() ? std::optional(message) : std::nullopt;
}

template std::optional<JointMessage> decode_ros1(std::span<const std::uint8_t>);
template std::optional<TrajectoryMessage> decode_ros1(std::span<const std::uint8_t>);
template std::optional<OperatingStateMessage> decode_ros1(std::span<const std::uint8_t>);
template std::optional<JoyMessage> decode_ros1(std::span<const std::uint8_t>);
template std::optional<StringMessage> decode_ros1(std::span<const std::uint8_t>);
template std::optional<ImageMessage> decode_ros1(std::span<const std::uint8_t>);
template std::optional<PlaceMessage> decode_ros1(std::span<const std::uint8_t>);
template std::optional<CompressedImageMessage> decode_ros1(std::span<const std::uint8_t>);

}  // namespace lapservo::internal
