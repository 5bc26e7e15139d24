#include "transports/ros2/cdr_encoder.h"

#include <bit>
#include <cmath>
#include <string>
#include <utility>

namespace lapservo::internal {
namespace {

static_assert(std::endian::native == std::endian::little, "encode_cdr() writes numbers as they lie in memory");

// Puts values behind one another, each at a multiple of its size from the end of the encapsulation on.
class CdrWriter {
 public:
  // Begins with a std_msgs/Header.
  explicit CdrWriter(double stamp_s) {
    const double whole_s = std::floor(stamp_s);
    const auto nanosec = std::llround(1e9 * (stamp_s - whole_s));
    number(static_cast<std::int32_t>(whole_s + (nanosec == 1000000000 ? 1 : 0)));
    number(static_cast<std::uint32_t>(nanosec % 1000000000));
    text("");  // frame_id
  }
  template <typename T>
  void number(T value) {
    align(sizeof(T));
    put(&value, sizeof(T));
  }
  // Its length counts the zero at its end.
  void text(const std::string& value) {
    number(static_cast<std::uint32_t>(value.size() + 1));
    put(value.c_str(), value.size() + 1);
  }
  void texts(const std::vector<std::string>& values) {
    number(static_cast<std::uint32_t>(values.size()));
    for (const std::string& value : values) text(value);
  }
  template <typename T>
  void numbers(const std::vector<T>& values) {
    number(static_cast<std::uint32_t>(values.size()));
    if (values.empty()) return;
    align(sizeof(T));
    put(values.data(), values.size() * sizeof(T));
  }
  std::vector<std::uint8_t> take() { return std::move(bytes_); }

 private:
  static constexpr std::size_t encapsulation = 4;

  void align(std::size_t size) {
    while ((bytes_.size() - encapsulation) % size != 0) bytes_.push_back(0);
  }
  void put(const void* from, std::size_t count) {
    const auto* const bytes = static_cast<const std::uint8_t*>(from);
    bytes_.insert(bytes_.end(), bytes, bytes + count);
  }

  std::vector<std::uint8_t> bytes_{0, 1, 0, 0};
};

}  // namespace

std::vector<std::uint8_t> encode_cdr(const JointMessage& message) {
  CdrWriter cdr(message.stamp_s);
  cdr.texts(message.names);
  cdr.numbers(message.positions);
  cdr.numbers(std::vector<double>());  // velocities
  cdr.numbers(std::vector<double>());  // efforts
  return cdr.take();
}

std::vector<std::uint8_t> encode_cdr(const ImageMessage& message) {
  CdrWriter cdr(message.stamp_s);
  cdr.number(message.height);
  cdr.number(message.width);
  cdr.text(message.encoding);
  cdr.number(static_cast<std::uint8_t>(message.is_bigendian));
  cdr.number(message.step);
  cdr.numbers(message.data);
  return cdr.take();
}

std::vector<std::uint8_t> encode_cdr(const CompressedImageMessage& message) {
  CdrWriter cdr(message.stamp_s);
  cdr.text(message.format);
  cdr.numbers(message.data);
  return cdr.take();
}

}  // namespace lapservo::internal
