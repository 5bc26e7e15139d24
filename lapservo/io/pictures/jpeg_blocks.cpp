#include "lapservo/io/pictures/jpeg_blocks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

namespace lapservo::internal {
namespace {

constexpr float least_impossible = 4;  // brightness levels beyond black or white and rounding

std::array<float, DCTSIZE> row_of_cosines(int row) {
  std::array<float, DCTSIZE> cosines{};
  for (int v = 0; v < DCTSIZE; ++v)
    cosines[static_cast<std::size_t>(v)] = static_cast<float>(std::cos((2 * row + 1) * v * std::numbers::pi / 16) *
                                                              (v == 0 ? 1 / 8.0 : std::numbers::sqrt2 / 8));
  return cosines;
}

JpegBorderLight border_light(const JCOEF* block, const JQUANT_TBL& scale) {
  static const std::array rows{row_of_cosines(0), row_of_cosines(1), row_of_cosines(6), row_of_cosines(7)};
  std::array<float, rows.size()> light{};
  for (std::size_t v = 0; v < DCTSIZE; ++v) {
    const float coefficient = static_cast<float>(block[v * DCTSIZE]) * static_cast<float>(scale.quantval[v * DCTSIZE]);
    for (std::size_t row = 0; row < rows.size(); ++row) light[row] += coefficient * rows[row][v];
  }
  return {.upper = light[0], .upper_inner = light[1], .lower = light[3], .lower_inner = light[2]};
}

// Beyond what light does on either side, gone on with in a straight line.
float step_between(const JpegBorderLight& above, const JpegBorderLight& below) {
  return 1.5F * (below.upper - above.lower) - 0.5F * (below.upper_inner - above.lower_inner);
}

// Error of a block's mean, in brightness levels.
float quantum_of(const JQUANT_TBL& scale) {
  return static_cast<float>(scale.quantval[0]) / 8;
}

bool is_impossible(const JCOEF* block, float quantum) {
  return std::abs(static_cast<float>(block[0]) * quantum) > 128 + quantum + least_impossible;
}

// One row of MCUs' upper borders, below the row of blocks before.
void add_steps(JpegComponent& component, int across, const std::vector<JpegBorderLight>& below) {
  const std::size_t width = below.size(), step_width = static_cast<std::size_t>(across);
  for (std::size_t first = 0; first < width; first += step_width) {
    const std::size_t end = std::min(first + step_width, width);
    float step = 0;
    for (std::size_t i = first; i < end; ++i) step += step_between(component.above[i], below[i]);
    component.steps.push_back(step / static_cast<float>(end - first));
  }
}

}  // namespace

void read_component(jpeg_decompress_struct& info, int index, jvirt_barray_ptr coefficients, JpegComponent& component) {
  const jpeg_component_info& layout = info.comp_info[index];
  if (layout.quant_table == nullptr) return;  // in no scan
  const JQUANT_TBL& scale = *layout.quant_table;
  const bool alone = info.num_components == 1;  // then an MCU is a block
  const int across = alone ? 1 : layout.h_samp_factor;
  const JDIMENSION down = alone ? 1 : static_cast<JDIMENSION>(layout.v_samp_factor);
  component.quantum = quantum_of(scale);
  component.columns = (static_cast<int>(layout.width_in_blocks) + across - 1) / across;
  component.above.resize(layout.width_in_blocks);
  std::vector<JpegBorderLight> light(layout.width_in_blocks);
  for (JDIMENSION i = 0; i < layout.height_in_blocks; ++i) {
    JBLOCKROW row = *info.mem->access_virt_barray(reinterpret_cast<j_common_ptr>(&info), coefficients, i, 1, FALSE);
    const bool first_of_mcu = i % down == 0, last_of_mcu = i % down + 1 == down;
    for (std::size_t column = 0; column < light.size(); ++column) {
      component.has_impossible = component.has_impossible || is_impossible(row[column], component.quantum);
      if (first_of_mcu || last_of_mcu) light[column] = border_light(row[column], scale);
    }
    if (i == 0) component.steps.assign(static_cast<std::size_t>(component.columns), 0);
    if (i > 0 && first_of_mcu) add_steps(component, across, light);
    if (last_of_mcu) std::swap(component.above, light);
  }
}

}  // namespace lapservo::internal
