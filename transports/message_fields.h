#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "lapservo/crtk/messages.h"

namespace lapservo::internal {

/// Takes values from the front of a message's bytes, as ROS 1 writes them or CDR, where each stands at a multiple of
/// its size. After the first that isn't there, all are zero and is_whole() is false.
class MessageBytes {
 public:
  static MessageBytes of_ros1(std::span<const std::uint8_t> bytes) {
    MessageBytes from;
    from.bytes_ = bytes;
    from.is_swapped_ = std::endian::native == std::endian::big;
    return from;
  }
  static MessageBytes of_cdr(std::span<const std::uint8_t> bytes) {
    constexpr std::size_t encapsulation = 4;  // 0, then 0 for big-endian or 1 for little-endian, and two of options
    MessageBytes from;
    from.is_cdr_ = true;
    from.is_whole_ = bytes.size() >= encapsulation && bytes[0] == 0 && bytes[1] <= 1;
    if (!from.is_whole_) return from;
    from.is_swapped_ = (bytes[1] == 1) != (std::endian::native == std::endian::little);
    from.bytes_ = bytes.subspan(encapsulation);
    return from;
  }

  template <typename T>
  requires std::is_arithmetic_v<T>
  void operator()(T& to) {
    using Stored = std::conditional_t<std::is_same_v<T, bool>, std::uint8_t, T>;
    const auto bytes = take(1, sizeof(Stored));
    to = static_cast<T>(bytes.empty() ? Stored{} : value<Stored>(bytes.data()));
  }
  /// In CDR its length counts a zero at its end.
  void operator()(std::string& to) {
    auto bytes = take(number<std::uint32_t>(), 1);
    if (is_cdr_ && !bytes.empty()) {
      if (bytes.back() != 0) fail();
      bytes = bytes.first(bytes.size() - 1);
    }
    to.assign(bytes.begin(), bytes.end());
  }
  template <typename T>
  void operator()(std::vector<T>& to) {
    const auto bytes = take(number<std::uint32_t>(), sizeof(T));
    to.resize(bytes.size() / sizeof(T));
    if (!to.empty()) std::memcpy(to.data(), bytes.data(), bytes.size());
    if (is_swapped_ && sizeof(T) > 1)
      for (std::size_t i = 0; i < to.size(); ++i) to[i] = value<T>(bytes.data() + i * sizeof(T));
  }
  void operator()(std::vector<std::string>& to) {
    for (auto count = number<std::uint32_t>(); count > 0 && is_whole_; --count) (*this)(to.emplace_back());
  }
  template <typename T>
  T number() {
    T value{};
    (*this)(value);
    return value;
  }
  template <typename T>
  void unused() {
    std::vector<T> numbers;
    (*this)(numbers);
  }
  /// A std_msgs/Header: its stamp, NaN where it is none, and its frame where the message has one.
  void header(auto& message) {
    if (!is_cdr_) number<std::uint32_t>();  // seq
    const double sec =
        is_cdr_ ? static_cast<double>(number<std::int32_t>()) : static_cast<double>(number<std::uint32_t>());
    const auto nanosec = number<std::uint32_t>();
    std::string frame_id;
    (*this)(frame_id);
    message.stamp_s = nanosec < 1000000000u ? sec + 1e-9 * nanosec : std::numeric_limits<double>::quiet_NaN();
    if constexpr (requires { message.frame; }) message.frame = std::move(frame_id);
  }
  bool is_whole() const { return is_whole_; }
  /// Whether nothing is left over. Some writers of CDR fill up to a multiple of four or eight bytes.
  bool is_all() const { return is_whole_ && bytes_.size() - at_ <= (is_cdr_ ? 8 : 0); }

 private:
  template <typename T>
  T value(const std::uint8_t* from) const {
    std::array<std::uint8_t, sizeof(T)> bytes;
    std::copy(from, from + sizeof(T), bytes.begin());
    if (is_swapped_) std::reverse(bytes.begin(), bytes.end());
    return std::bit_cast<T>(bytes);
  }
  // None of them are not aligned either.
  std::span<const std::uint8_t> take(std::uint64_t count, std::uint64_t size) {
    if (count == 0) return {};
    const std::uint64_t begin = is_cdr_ ? (at_ + size - 1) / size * size : at_;
    if (begin + count * size > bytes_.size()) fail();
    if (!is_whole_) return {};
    at_ = begin + count * size;
    return bytes_.subspan(begin, count * size);
  }
  void fail() {
    is_whole_ = false;
    at_ = bytes_.size();
  }

  std::span<const std::uint8_t> bytes_;
  std::uint64_t at_ = 0;
  bool is_whole_ = true, is_cdr_ = false, is_swapped_ = false;
};

// The fields after the header of messages that are the same in ROS 1 and 2, in their order. `each(field)` reads it, or
// writes it; what is unused is skipped, or written empty.

void in_order(auto& each, Is<JointMessage> auto& message) {
  each(message.names);
  each(message.positions);
  each.template unused<double>();  // velocity
  each.template unused<double>();  // effort
}

void in_order(auto& each, Is<PlaceMessage> auto& message) {
  for (auto& value : message.pose.translation) each(value);
  for (auto& value : message.pose.rotation.coeffs()) each(value);  // x, y, z, w
}

void in_order(auto& each, Is<ImageMessage> auto& message) {
  each(message.height);
  each(message.width);
  each(message.encoding);
  each(message.is_bigendian);
  each(message.step);
  each(message.data);
}

void in_order(auto& each, Is<CompressedImageMessage> auto& message) {
  each(message.format);
  each(message.data);
}

}  // namespace lapservo::internal
