#pragma once

#include <optional>
#include <span>

namespace lapservo::internal {

/// Blocks of one colour component, as their top borders tell it, in the order in which a JPEG's data hold them.
struct JpegBlocks {
  std::span<const float> steps;  // across each block's upper border, beyond what light does on either side of it
  float quantum = 0;             // what blocks' means are multiples of
  int columns = 0;
  int restart_interval = 0;  // blocks after which the data begin anew, 0: never
};

/// JPEG's data hold each block's mean as the difference to the block before. A difference that is misread, of which no
/// decoder can know, therefore shifts all that follows, up to the next restart. Such a shift begins within a row, is
/// the same for all blocks but for noise, and shows in their upper borders: to the end of the row, and from the
/// beginning of the next one to the same column. No camera's picture looks like it; what is drawn may, but has no
/// noise. In the steps' unit; nothing where there is none, or where it begins in the first row or in one's first or
/// last three blocks.
std::optional<float> dc_shift(const JpegBlocks& blocks);

}  // namespace lapservo::internal
