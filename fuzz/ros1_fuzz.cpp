#include <cstddef>
#include <cstdint>
#include <span>

#include "fuzz/require.h"
#include "transports/ros1/ros1_decoder.h"

// Any bytes are a message that holds no more than they do, or none.
namespace {
using namespace lapservo;
using namespace lapservo::internal;
using fuzz::require;

void read(std::span<const std::uint8_t> bytes) {
  if (const auto joints = decode_ros1<JointMessage>(bytes))
    require(4 * joints->names.size() + 8 * joints->positions.size() <= bytes.size(), "joints are in the bytes");
  if (const auto image = decode_ros1<ImageMessage>(bytes))
    require(image->data.size() + image->encoding.size() < bytes.size(), "pixels are in the bytes");
  if (const auto image = decode_ros1<CompressedImageMessage>(bytes))
    require(image->data.size() + image->format.size() < bytes.size(), "a picture is in the bytes");
  if (const auto state = decode_ros1<OperatingStateMessage>(bytes))
    require(state->state.size() < bytes.size(), "a state is in the bytes");
  if (const auto text = decode_ros1<StringMessage>(bytes))
    require(text->text.size() < bytes.size(), "a text is in the bytes");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  read({data, size});
  return 0;
}
