#include "lapservo/vision/blob_search.h"

#include <algorithm>
#include <cstddef>

namespace lapservo {

std::vector<Blob> find_blobs(const ImageView& image, const ColorClasses& classes, int grid_px, int least_samples) {
  const int columns = image.width_px / grid_px, rows = image.height_px / grid_px, first = grid_px / 2;
  std::vector<std::uint8_t> grid(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  std::vector<int> colored;
  for (int row = 0; row < rows; ++row) {
    const std::uint8_t* pixel = image.pixel(first, first + row * grid_px);
    for (int column = 0; column < columns; ++column, pixel += 3 * static_cast<std::ptrdiff_t>(grid_px)) {
      const std::uint8_t color = classes(pixel);
      const int cell = row * columns + column;
      grid[static_cast<std::size_t>(cell)] = color;
      if (color) colored.push_back(cell);
    }
  }

  // Sensor noise in the dark has colours too, but neighbours do not share them.
  constexpr int least_alike = 3;
  const auto alike = [&](int cell) {
    const int column = cell % columns, row = cell / columns;
    int count = 0;
    for (int r = std::max(0, row - 1); r <= std::min(rows - 1, row + 1); ++r)
      for (int c = std::max(0, column - 1); c <= std::min(columns - 1, column + 1); ++c)
        count += grid[static_cast<std::size_t>(r * columns + c)] == grid[static_cast<std::size_t>(cell)];
    return count - 1 >= least_alike;
  };
  std::vector<int> lonely;
  for (const int cell : colored)
    if (!alike(cell)) lonely.push_back(cell);
  for (const int cell : lonely) grid[static_cast<std::size_t>(cell)] = 0;

  constexpr int reach = 2;  // cells: bridges a highlight along the shaft and blotches of blood
  std::vector<Blob> blobs;
  std::vector<int> stack;
  for (const int seed : colored) {
    if (!grid[static_cast<std::size_t>(seed)]) continue;
    Blob blob;
    blob.grid_px = grid_px;
    const auto take = [&](int column, int row) {
      const int cell = row * columns + column;
      std::uint8_t& color = grid[static_cast<std::size_t>(cell)];
      if (!color) return;
      blob.samples.push_back({first + column * grid_px, first + row * grid_px, color});
      color = 0;
      stack.push_back(cell);
    };
    take(seed % columns, seed / columns);
    while (!stack.empty()) {
      const int column = stack.back() % columns, row = stack.back() / columns;
      stack.pop_back();
      for (int r = std::max(0, row - reach); r <= std::min(rows - 1, row + reach); ++r)
        for (int c = std::max(0, column - reach); c <= std::min(columns - 1, column + reach); ++c) take(c, r);
    }
    if (static_cast<int>(blob.samples.size()) >= least_samples) blobs.push_back(std::move(blob));
  }
  std::sort(blobs.begin(), blobs.end(),
            [](const Blob& a, const Blob& b) { return a.samples.size() > b.samples.size(); });
  return blobs;
}

}  // namespace lapservo
