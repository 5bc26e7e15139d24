#pragma once

#include <optional>
#include <span>

namespace lapservo::internal {

/// Top borders of the blocks of one colour component, in the order in which a JPEG's data hold them.
struct JpegBlocks {
  std::span<const float> steps;  // across each block's upper border, beyond what light does on either side of it
  float quantum = 0;             // what blocks' means are multiples of
  int columns = 0;
  int restart_interval = 0;  // blocks after which the data begin anew, 0: never
};

/// JPEG's data hold each block's mean as the difference to the block before. A misread difference, which no decoder can
/// notice, therefore shifts all following blocks, up to the next restart. Such a shift begins within a row, is the same
/// for all blocks except for noise, and shows in their upper borders: to the end of the row, and from the beginning of
/// the next one to the same column. No camera's image looks like it; a drawn image may, but has no noise. In the steps'
/// unit; nullopt where there is none, or where it begins in the first row or in one's first or last three blocks.
std::optional<float> dc_shift(const JpegBlocks& blocks);

}  // namespace lapservo::internal
