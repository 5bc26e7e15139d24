#pragma once

#include <cstddef>
#include <cstdio>
#include <jpeglib.h>
#include <vector>

namespace lapservo::internal {

/// A block's light at its upper and lower border, in brightness levels: means over rows, so of the coefficients only
/// those that don't vary along a row count.
struct JpegBorderLight {
  float upper = 0, upper_inner = 0, lower = 0, lower_inner = 0;
};

/// Layout of one colour component, by its minimum coded units (MCU, one or more blocks).
struct JpegComponent {
  std::vector<float> steps;  // jpeg_dc_shift.h
  float quantum = 0;
  int columns = 0;
  std::vector<JpegBorderLight> above;  // of the row of blocks before
  bool has_impossible = false;         // a block that is darker than black or brighter than white as a whole
};

/// Borders from the component's coefficients, all of which have been read. May leave by the library's error_exit.
void read_component(jpeg_decompress_struct& info, int index, jvirt_barray_ptr coefficients, JpegComponent& component);

}  // namespace lapservo::internal
