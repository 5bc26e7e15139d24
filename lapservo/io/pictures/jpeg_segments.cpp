#include "lapservo/io/pictures/jpeg_segments.h"

#include <algorithm>

#include "lapservo/io/tables/numbers.h"

namespace lapservo::internal {
namespace {

bool stands_alone(std::uint8_t marker) {
  return marker == 0x01 || (marker >= 0xd0 && marker <= 0xd9);
}

}  // namespace

std::optional<JpegSegment> jpeg_segment(std::span<const std::uint8_t> jpeg, std::size_t from) {
  for (std::size_t at = from; at + 2 <= jpeg.size(); ++at) {
    // Within scans 00 follows an FF that is data.
    if (jpeg[at] != 0xff || jpeg[at + 1] == 0 || jpeg[at + 1] == 0xff) continue;
    const std::size_t content = at + (stands_alone(jpeg[at + 1]) ? 2 : 4);
    const std::size_t length = Numbers{jpeg, true}.of(at + 2, 2);
    const std::size_t end = content == at + 2 ? content : at + 2 + std::max<std::size_t>(length, 2);
    if (end > jpeg.size()) return std::nullopt;
    return JpegSegment{jpeg[at + 1], jpeg.subspan(content, end - content), at, end};
  }
  return std::nullopt;
}

}  // namespace lapservo::internal
