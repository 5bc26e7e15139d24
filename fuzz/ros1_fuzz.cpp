#include <cstddef>
#include <cstdint>
#include <span>

#include "fuzz/require_messages.h"
#include "transports/ros1/ros1_decoder.h"

// Any bytes are a message that holds no more than they do, or none.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace lapservo;
  using namespace lapservo::internal;
  using fuzz::require;
  const std::span bytes(data, size);
  fuzz::require_messages_within([]<typename Message>(const auto& from) { return decode_ros1<Message>(from); }, bytes);
  if (const auto trajectory = decode_ros1<TrajectoryMessage>(bytes))
    require(4 * trajectory->names.size() + 24 * trajectory->points.size() <= bytes.size(), "points are in the bytes");
  if (const auto state = decode_ros1<OperatingStateMessage>(bytes))
    require(state->state.size() < bytes.size(), "a state is in the bytes");
  if (const auto text = decode_ros1<StringMessage>(bytes))
    require(text->text.size() < bytes.size(), "a text is in the bytes");
  return 0;
}
