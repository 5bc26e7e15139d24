#include "transports/ros1/ros1_decoder.h"

#include <bit>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

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
  /// Of a std_msgs/Header.
  double stamp_s() {
    number<std::uint32_t>();  // seq
    const auto sec = number<std::uint32_t>(), nsec = number<std::uint32_t>();
    text();  // frame_id
    return nsec < 1000000000u ? sec + 1e-9 * nsec : std::numeric_limits<double>::quiet_NaN();
  }
  template <typename Message>
  std::optional<Message> result(Message&& message) const {
    if (!whole_ || !rest_.empty()) return std::nullopt;
    return std::move(message);
  }

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

}  // namespace

template <>
std::optional<JointMessage> decode_ros1(std::span<const std::uint8_t> bytes) {
  Bytes from(bytes);
  JointMessage message;
  message.stamp_s = from.stamp_s();
  message.names = from.texts();
  message.positions = from.numbers<double>();
  from.numbers<double>();  // velocity
  from.numbers<double>();  // effort
  return from.result(std::move(message));
}

template <>
std::optional<OperatingStateMessage> decode_ros1(std::span<const std::uint8_t> bytes) {
  Bytes from(bytes);
  OperatingStateMessage message;
  message.stamp_s = from.stamp_s();
  message.state = from.text();
  message.is_homed = from.number<std::uint8_t>() != 0;
  message.is_busy = from.number<std::uint8_t>() != 0;
  return from.result(std::move(message));
}

template <>
std::optional<StringMessage> decode_ros1(std::span<const std::uint8_t> bytes) {
  Bytes from(bytes);
  StringMessage message;
  message.stamp_s = from.stamp_s();
  message.text = from.text();
  return from.result(std::move(message));
}

template <>
std::optional<ImageMessage> decode_ros1(std::span<const std::uint8_t> bytes) {
  Bytes from(bytes);
  ImageMessage message;
  message.stamp_s = from.stamp_s();
  message.height = from.number<std::uint32_t>();
  message.width = from.number<std::uint32_t>();
  message.encoding = from.text();
  message.is_bigendian = from.number<std::uint8_t>() != 0;
  message.step = from.number<std::uint32_t>();
  message.data = from.numbers<std::uint8_t>();
  return from.result(std::move(message));
}

template <>
std::optional<CompressedImageMessage> decode_ros1(std::span<const std::uint8_t> bytes) {
  Bytes from(bytes);
  CompressedImageMessage message;
  message.stamp_s = from.stamp_s();
  message.format = from.text();
  message.data = from.numbers<std::uint8_t>();
  return from.result(std::move(message));
}

}  // namespace lapservo::internal
