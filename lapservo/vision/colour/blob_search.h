#pragma once

#include <cstdint>
#include <vector>

#include "lapservo/vision/colour/colour_classes.h"
#include "lapservo/vision/image/light_image.h"

namespace lapservo::internal {

/// Distance of neighbouring samples, and a blob's size: smaller ones leave too few boundaries for a fit.
inline constexpr int blob_grid_px = 8, min_blob_samples = 8;

/// Pixels of the markers' colours that lie together, sampled on a sparse grid.
struct Blob {
  struct Sample {
    int u, v;
    std::uint8_t colour;
  };
  std::vector<Sample> samples;
};

/// As many as detection looks at: first those of two colours and more, largest first. Reads only the grid's pixels.
std::vector<Blob> largest_blobs(const ImageView& image, const ColourClasses& classes);

/// Those that blood may have parted as one: nearer to one another than half of what the larger one reaches over.
std::vector<Blob> joined_blobs(const std::vector<Blob>& blobs);

}  // namespace lapservo::internal
