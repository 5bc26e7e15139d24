#pragma once

#include <cstdint>
#include <vector>

#include "lapservo/vision/colour/colour_classes.h"
#include "lapservo/vision/image/image_view.h"

namespace lapservo::internal {

/// Pixels of the markers' colours that lie together, sampled on a sparse grid.
struct Blob {
  struct Sample {
    int u, v;
    std::uint8_t colour;
  };
  std::vector<Sample> samples;
  int grid_px = 0;  ///< distance of neighbouring samples
};

/// A blob's size on a grid of 8 px: smaller ones leave too few boundaries for a fit.
inline constexpr int min_blob_samples = 8;

/// All groups of coloured samples of at least `min_samples`, largest first. Touches one pixel in grid_px^2 only.
std::vector<Blob> find_blobs(const ImageView& image, const ColourClasses& classes, int grid_px, int min_samples);

/// As many of them as detection looks at, on its grid: first those of two colours and more, largest first.
std::vector<Blob> largest_blobs(const ImageView& image, const ColourClasses& classes);

/// The same, but as one those that blood may have parted: nearer to one another than half of what the larger one
/// reaches over.
std::vector<Blob> joined_blobs(const std::vector<Blob>& blobs);

}  // namespace lapservo::internal
