#include "transports/ros2/cdr_decoder.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "transports/message_fields.h"

namespace lapservo::internal {
namespace {

// Takes values from the front, each at a multiple of its size. After the first that isn't there, all are zero.
class CdrBytes {
 public:
  explicit CdrBytes(std::span<const std::uint8_t> bytes) {
    constexpr std::size_t encapsulation = 4;  // 0, then 0 for big-endian or 1 for little-endian, and two of options
    whole_ = bytes.size() >= encapsulation && bytes[0] == 0 && bytes[1] <= 1;
    if (!whole_) return;
    swap_ = (bytes[1] == 1) != (std::endian::native == std::endian::little);
    bytes_ = bytes.subspan(encapsulation);
  }

  template <typename T>
  T number() {
    const auto bytes = take(1, sizeof(T));
    return bytes.empty() ? T{} : value<T>(bytes.data());
  }
  // Its length counts the zero at its end.
  std::string text() {
    const auto bytes = take(number<std::uint32_t>(), 1);
    if (bytes.empty()) return {};
    if (bytes.back() != 0) fail();
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size() - 1};
  }
  template <typename T>
  std::vector<T> numbers() {
    const auto bytes = take(number<std::uint32_t>(), sizeof(T));
    std::vector<T> values(bytes.size() / sizeof(T));
    if (!values.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
    if (swap_ && sizeof(T) > 1)
      for (std::size_t i = 0; i < values.size(); ++i) values[i] = value<T>(bytes.data() + i * sizeof(T));
    return values;
  }
  std::vector<std::string> texts() {
    std::vector<std::string> values;
    for (auto count = number<std::uint32_t>(); count > 0 && whole_; --count) values.push_back(text());
    return values;
  }
  /// The stamp of a std_msgs/Header.
  double stamp_s() {
    const auto sec = number<std::int32_t>();
    const auto nanosec = number<std::uint32_t>();
    text();  // frame_id
    return nanosec < 1000000000u ? sec + 1e-9 * nanosec : std::numeric_limits<double>::quiet_NaN();
  }
  /// Some writers fill up to a multiple of four or eight bytes.
  bool whole() const { return whole_ && bytes_.size() - at_ <= 8; }

 private:
  template <typename T>
  T value(const std::uint8_t* from) const {
    std::array<std::uint8_t, sizeof(T)> bytes;
    std::copy(from, from + sizeof(T), bytes.begin());
    if (swap_) std::reverse(bytes.begin(), bytes.end());
    return std::bit_cast<T>(bytes);
  }
  // None of them are not aligned either.
  std::span<const std::uint8_t> take(std::uint64_t count, std::uint64_t size) {
    if (count == 0) return {};
    const std::uint64_t begin = (at_ + size - 1) / size * size;
    if (begin + count * size > bytes_.size()) fail();
    if (!whole_) return {};
    at_ = begin + count * size;
    return bytes_.subspan(begin, count * size);
  }
  void fail() {
    whole_ = false;
    at_ = bytes_.size();
  }

  std::span<const std::uint8_t> bytes_;
  std::uint64_t at_ = 0;
  bool whole_ = false, swap_ = false;
};

}  // namespace

template <typename Message>
std::optional<Message> decode_cdr(std::span<const std::uint8_t> bytes) {
  CdrBytes from(bytes);
  Message message;
  message.stamp_s = from.stamp_s();
  read_fields(from, message);
  if (!from.whole()) return std::nullopt;
  return message;
}

template std::optional<JointMessage> decode_cdr(std::span<const std::uint8_t>);
template std::optional<ImageMessage> decode_cdr(std::span<const std::uint8_t>);
template std::optional<CompressedImageMessage> decode_cdr(std::span<const std::uint8_t>);

}  // namespace lapservo::internal
