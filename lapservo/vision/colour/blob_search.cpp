#include "lapservo/vision/colour/blob_search.h"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <functional>
#include <iterator>
#include <span>
#include <utility>

#include <Eigen/Geometry>

namespace lapservo::internal {
namespace {

// Classes of the grid's samples, framed by cells without colour, so that a cell's neighbourhood always exists.
class Grid {
 public:
  static constexpr int reach = 2;  // cells: bridges a highlight along the shaft and blotches of blood
  static constexpr int around = 2 * reach + 1;

  Grid(const ImageView& image, const ColourClasses& classes) : columns_(image.width_px / blob_grid_px) {
    const int rows = image.height_px / blob_grid_px;
    cells_.resize(static_cast<std::size_t>(stride()) * static_cast<std::size_t>(rows + 2 * reach));
    for (int row = 0; row < rows; ++row) {
      const int first = (row + reach) * stride() + reach;
      const std::span<std::uint8_t> line(&at(first), static_cast<std::size_t>(columns_));
      classes.classify(image.pixel(middle_of(0), middle_of(row)), 3 * blob_grid_px, line);
      constexpr std::size_t at_once = 8;  // few have a colour
      for (std::size_t i = 0; i < line.size(); i += at_once) {
        const std::size_t count = std::min(at_once, line.size() - i);
        std::uint64_t any = 0;
        std::memcpy(&any, &line[i], count);
        for (std::size_t j = i; any && j < i + count; ++j)
          if (line[j]) coloured_.push_back(first + static_cast<int>(j));
      }
    }
  }

  /// Cells that had a colour at first.
  const std::vector<int>& coloured() const { return coloured_; }
  std::uint8_t& at(int cell) { return cells_[static_cast<std::size_t>(cell)]; }
  /// `around` cells from the left to the right of a neighbour `rows` further down.
  std::uint8_t* row_around(int cell, int rows) { return &at(cell + rows * stride() - reach); }
  int cell_of(const std::uint8_t* place) const { return static_cast<int>(place - cells_.data()); }
  Blob::Sample sample(int cell) {
    return {middle_of(cell % stride() - reach), middle_of(cell / stride() - reach), at(cell)};
  }

 private:
  static int middle_of(int cell) { return blob_grid_px / 2 + cell * blob_grid_px; }
  int stride() const { return columns_ + 2 * reach; }
  int columns_;
  std::vector<std::uint8_t> cells_;
  std::vector<int> coloured_;
};

// Sensor noise in the dark has colours too, but neighbours do not share them.
void drop_lonely(Grid& grid) {
  constexpr int least_alike = 3;
  std::vector<int> lonely;
  for (const int cell : grid.coloured()) {
    int count = -1;  // itself
    for (int row = -1; row <= 1; ++row) {
      const std::uint8_t* places = grid.row_around(cell, row);
      for (int i = Grid::reach - 1; i <= Grid::reach + 1; ++i) count += places[i] == grid.at(cell);
    }
    if (count < least_alike) lonely.push_back(cell);
  }
  for (const int cell : lonely) grid.at(cell) = 0;
}

// Moves what hangs together with a cell out of the grid.
Blob take_blob(Grid& grid, int seed, std::vector<int>& stack) {
  Blob blob;
  const auto take = [&](int cell) {
    blob.samples.push_back(grid.sample(cell));
    grid.at(cell) = 0;
    stack.push_back(cell);
  };
  take(seed);
  while (!stack.empty()) {
    const int cell = stack.back();
    stack.pop_back();
    for (int row = -Grid::reach; row <= Grid::reach; ++row) {
      const std::uint8_t* places = grid.row_around(cell, row);
      std::uint64_t any = 0;  // most are taken already: look at all at once
      std::memcpy(&any, places, Grid::around);
      if (!any) continue;
      for (int i = 0; i < Grid::around; ++i)
        if (places[i]) take(grid.cell_of(places + i));
    }
  }
  return blob;
}

Eigen::AlignedBox2d box_about(const Blob& blob) {
  Eigen::AlignedBox2d box;
  for (const Blob::Sample& sample : blob.samples) box.extend(Eigen::Vector2d(sample.u, sample.v));
  return box;
}

bool lie_near(const Eigen::AlignedBox2d& a, const Eigen::AlignedBox2d& b) {
  constexpr double of_length = 0.5;
  return a.exteriorDistance(b) < of_length * std::max(a.diagonal().norm(), b.diagonal().norm());
}

// A marker does, unless all but one of its bands are hidden.
bool shows_two_colours(const Blob& blob) {
  constexpr std::ptrdiff_t least = 2;
  const auto same = std::ranges::count(blob.samples, blob.samples[0].colour, &Blob::Sample::colour);
  return same >= least && std::ssize(blob.samples) - same >= least;
}

}  // namespace

std::vector<Blob> largest_blobs(const ImageView& image, const ColourClasses& classes) {
  constexpr std::size_t max_blobs = 6;  // bounds the time that tissue with the marker's colours costs
  Grid grid(image, classes);
  drop_lonely(grid);
  std::vector<Blob> blobs;
  std::vector<int> stack;
  for (const int seed : grid.coloured()) {
    if (!grid.at(seed)) continue;
    Blob blob = take_blob(grid, seed, stack);
    if (std::ssize(blob.samples) >= min_blob_samples) blobs.push_back(std::move(blob));
  }
  std::ranges::sort(blobs, std::greater{}, [](const Blob& blob) { return blob.samples.size(); });
  std::stable_partition(blobs.begin(), blobs.end(), shows_two_colours);
  if (blobs.size() > max_blobs) blobs.resize(max_blobs);
  return blobs;
}

std::vector<Blob> joined_blobs(const std::vector<Blob>& blobs) {
  std::vector<Eigen::AlignedBox2d> boxes;
  std::vector<std::size_t> group_of;
  for (const Blob& blob : blobs) group_of.push_back(group_of.size()), boxes.push_back(box_about(blob));
  for (std::size_t i = 0; i < blobs.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (group_of[i] != group_of[j] && lie_near(boxes[i], boxes[j]))
        std::replace(group_of.begin(), group_of.end(), group_of[i], group_of[j]);
  std::vector<Blob> joined;
  for (std::size_t group = 0; group < blobs.size(); ++group) {
    Blob together;
    for (std::size_t i = 0; i < blobs.size(); ++i)
      if (group_of[i] == group)
        together.samples.insert(together.samples.end(), blobs[i].samples.begin(), blobs[i].samples.end());
    if (!together.samples.empty()) joined.push_back(std::move(together));
  }
  return joined;
}

}  // namespace lapservo::internal
