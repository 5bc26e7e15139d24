#include "transports/ros2/cdr.h"

#include <bit>
#include <cmath>
#include <string>
#include <type_traits>
#include <utility>

#include "transports/message_fields.h"

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
    (*this)(static_cast<std::int32_t>(whole_s + (nanosec == 1000000000 ? 1 : 0)));
    (*this)(static_cast<std::uint32_t>(nanosec % 1000000000));
    (*this)(std::string());  // frame_id
  }
  template <typename T>
  requires std::is_arithmetic_v<T>
  void operator()(T value) {
    align(sizeof(T));
    put(&value, sizeof(T));
  }
  // Its length counts the zero at its end.
  void operator()(const std::string& value) {
    size(value.size() + 1);
    put(value.c_str(), value.size() + 1);
  }
  void operator()(const std::vector<std::string>& values) {
    size(values.size());
    for (const std::string& value : values) (*this)(value);
  }
  template <typename T>
  void operator()(const std::vector<T>& values) {
    size(values.size());
    if (values.empty()) return;
    align(sizeof(T));
    put(values.data(), values.size() * sizeof(T));
  }
  template <typename T>
  void unused() {
    size(0);
  }
  std::vector<std::uint8_t> take() { return std::move(bytes_); }

 private:
  static constexpr std::size_t encapsulation = 4;

  void size(std::size_t count) { (*this)(static_cast<std::uint32_t>(count)); }
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

template <typename Message>
std::optional<Message> decode_cdr(std::span<const std::uint8_t> bytes) {
  auto from = MessageBytes::of_cdr(bytes);
  Message message;
  from.header(message);
  in_order(from, message);
  return from.is_all() ? std::optional(std::move(message)) : std::nullopt;
}

template std::optional<JointMessage> decode_cdr(std::span<const std::uint8_t>);
template std::optional<ImageMessage> decode_cdr(std::span<const std::uint8_t>);
template std::optional<CompressedImageMessage> decode_cdr(std::span<const std::uint8_t>);
template std::optional<PlaceMessage> decode_cdr(std::span<const std::uint8_t>);

template <typename Message>
std::vector<std::uint8_t> encode_cdr(const Message& message) {
  CdrWriter cdr(message.stamp_s);
  in_order(cdr, message);
  return cdr.take();
}

template std::vector<std::uint8_t> encode_cdr(const JointMessage&);
template std::vector<std::uint8_t> encode_cdr(const ImageMessage&);
template std::vector<std::uint8_t> encode_cdr(const CompressedImageMessage&);

}  // namespace lapservo::internal
