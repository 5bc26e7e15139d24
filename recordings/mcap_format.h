#pragma once

#include <array>
#include <cstdint>

// The file format MCAP, version 0 (https://mcap.dev/spec): records of an opcode, a length in 64 bits and a content,
// between two magic numbers. Little-endian; texts, lists and tables stand behind their length in 32 bits.
namespace lapservo::internal::mcap {

inline constexpr std::array<std::uint8_t, 8> magic{0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};

enum class Op : std::uint8_t {
  none = 0,
  header = 1,
  footer = 2,
  schema = 3,
  channel = 4,
  message = 5,
  chunk = 6,
  chunk_index = 8,
  statistics = 11,
  data_end = 15
};

inline constexpr std::uint64_t record_head = 9;    ///< opcode and length
inline constexpr std::uint64_t message_head = 22;  ///< of a message: channel, sequence number, two times
inline constexpr std::uint64_t footer_size = 20;

}  // namespace lapservo::internal::mcap
