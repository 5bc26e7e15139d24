#include "recordings/mcap_messages.h"

#include <algorithm>
#include <array>
#include <utility>
#include <zlib.h>

#include <fmt/format.h>

#include "lapservo/core/error.h"
#include "recordings/chunk_compression.h"

namespace lapservo::internal {
using namespace mcap;
namespace {

[[noreturn]] void refuse_damage(const FileBytes& file, std::uint64_t at) {
  throw InputError(file.path(),
                   fmt::format("is damaged at byte {}, expected a whole MCAP recording: copy it again, or try "
                               "`mcap recover`",
                               at));
}

std::optional<std::string> text_taken(ByteView& from) {
  const auto text = block_taken(from);
  return text ? std::optional(std::string(text->begin(), text->end())) : std::nullopt;
}

std::optional<McapMessages::Message> message_taken(ByteView& from) {
  const auto channel = taken<std::uint16_t>(from);
  taken<std::uint32_t>(from);  // its sequence number
  const auto recorded_ns = taken<std::uint64_t>(from), published_ns = taken<std::uint64_t>(from);
  if (!published_ns) return std::nullopt;
  return McapMessages::Message{*channel, *recorded_ns};
}

}  // namespace

bool McapChannels::add(Op op, ByteView content) {
  if (op != Op::schema && op != Op::channel) return true;
  const auto number = taken<std::uint16_t>(content);
  const auto schema = op == Op::channel ? taken<std::uint16_t>(content) : std::optional<std::uint16_t>(0);
  const auto name = text_taken(content), format = text_taken(content);
  if (!number || !schema || !format) return false;
  if (op == Op::schema) return types.emplace(*number, *name), true;
  const auto type = types.find(*schema);
  topics.try_emplace(*number, Ros2FileTopic{*name, type == types.end() ? std::string() : type->second, *format});
  return true;
}

bool has_mcap_crc(ByteView bytes, std::uint32_t crc) {
  return crc == 0 || crc == crc32_z(0, bytes.data(), bytes.size());
}

std::optional<McapMessages::Message> McapMessages::next() {
  while (!rest_.empty() || at_ < end_)
    if (const auto message = rest_.empty() ? next_in_file() : next_in_chunk()) return message;
  return std::nullopt;
}

ByteView McapMessages::data() {
  if (data_at_ == 0) return data_;
  auto bytes = file_.bytes(data_at_, data_size_);
  if (!bytes) refuse_damage(file_, data_at_);
  loose_ = std::move(*bytes);
  data_at_ = 0;
  return data_ = loose_;
}

std::optional<McapMessages::Message> McapMessages::next_in_chunk() {
  const auto op = taken<Op>(rest_);
  const auto content = block_taken<std::uint64_t>(rest_);
  data_ = content.value_or(ByteView()), data_at_ = 0;
  const auto message = op == Op::message ? message_taken(data_) : std::nullopt;
  if (content && op != Op::none && (message || op != Op::message) && channels_.add(*op, *content)) return message;
  if (!ends_early_at_) refuse_damage(file_, chunk_at_);
  rest_ = {};
  return std::nullopt;
}

std::optional<McapMessages::Message> McapMessages::next_in_file() {
  const std::uint64_t begin = at_, left = end_ - begin;
  const auto head = file_.bytes(begin, std::min(left, record_head));
  if (!head) refuse_damage(file_, begin);
  ByteView from(*head);
  const auto op = taken<Op>(from);
  const auto size = taken<std::uint64_t>(from);
  const bool is_whole = size && op != Op::none && *size <= left - record_head;
  is_finished_ = is_whole && (op == Op::data_end || op == Op::footer);
  at_ = is_whole && !is_finished_ ? begin + record_head + *size : end_;
  if (!is_whole) {
    if (!may_end_early_) refuse_damage(file_, begin);
    ends_early_at_ = begin;
    if (size && op == Op::chunk) open_chunk(begin, left - record_head);
    return std::nullopt;
  }
  if (op == Op::chunk) open_chunk(begin, *size);
  if (op == Op::schema || op == Op::channel) {
    const auto content = file_.bytes(begin + record_head, *size);
    if (!content || !channels_.add(*op, *content)) refuse_damage(file_, begin);
  }
  if (op != Op::message) return std::nullopt;
  const auto fields = file_.bytes(begin + record_head, std::min(*size, message_head));
  ByteView of_message = fields ? ByteView(*fields) : ByteView();
  const auto message = message_taken(of_message);
  if (!message) refuse_damage(file_, begin);
  data_at_ = begin + record_head + message_head, data_size_ = *size - message_head;
  return message;
}

void McapMessages::open_chunk(std::uint64_t at, std::uint64_t size) {
  chunk_at_ = at;
  auto bytes = size <= most_of_a_chunk ? file_.bytes(at + record_head, size) : std::nullopt;
  if (!bytes) refuse_damage(file_, at);
  chunk_ = std::move(*bytes);
  if (unpack_chunk()) return;
  rest_ = {};
  if (!ends_early_at_) refuse_damage(file_, at);
}

// False for what is damaged. One that ends early has no checksum.
bool McapMessages::unpack_chunk() {
  ByteView from(chunk_);
  taken<std::array<std::uint64_t, 2>>(from);  // its times
  const auto size = taken<std::uint64_t>(from);
  const auto crc = taken<std::uint32_t>(from);
  const auto compression = text_taken(from);
  const auto packed_size = taken<std::uint64_t>(from);
  if (!packed_size || *size > most_of_a_chunk) return false;
  from = from.first(std::min<std::uint64_t>(*packed_size, from.size()));
  const bool is_whole = !ends_early_at_ && from.size() == *packed_size;
  rest_ = from;
  if (!compression->empty()) {
    auto content = inflated(*compression, from, *size);
    if (!content) return false;
    chunk_ = std::move(*content);
    rest_ = chunk_;
  }
  return ends_early_at_ || (is_whole && rest_.size() == *size && has_mcap_crc(rest_, *crc));
}

}  // namespace lapservo::internal
