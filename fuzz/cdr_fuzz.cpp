#include <cstddef>
#include <cstdint>
#include <span>

#include "fuzz/require_messages.h"
#include "transports/ros2/cdr.h"

// Any bytes of a bag are a message that holds no more than they do, or none.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  lapservo::fuzz::require_messages_within(
      []<typename Message>(const auto& bytes) { return lapservo::internal::decode_cdr<Message>(bytes); },
      std::span(data, size));
  return 0;
}
