#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace lapservo::internal {

/// How many images a PNG, JPEG, PNM, BMP or WebP holds: one after the other, or as its own animation.
/// 1 for a JPEG that says which of its images is the first one (MPF, as phones append depth and brightness), and
/// where that can't be seen.
std::size_t picture_count(std::span<const std::uint8_t> bytes);

}  // namespace lapservo::internal
