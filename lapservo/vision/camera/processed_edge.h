#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "lapservo/vision/camera/pooled_edges.h"

namespace lapservo::internal {

/// A camera's processing of an image, the same everywhere in a frame, in this order.
struct PictureProcessing {
  double blur_px = 1;              ///< of the light
  double log_mosaic = 0;           ///< log of how much wider red and blue light is blurred than green: demosaicing
  double chroma_variance_px2 = 0;  ///< of the blur of encoded colour differences: subsampling, compression
  double saturation = 1;           ///< by which colour differences (Rec. 601) are multiplied
  double sharpening = 0;           ///< unsharp mask: so much of what the blur takes away is added
  double sharpening_px = 1.2;      ///< that blur
  /// By how much colour differences lie beside luma, along the boundaries' normals: chroma that is read as if it were
  /// sited elsewhere, or repeated in place of interpolated.
  double chroma_shift_px = 0;
};

/// The same as unknowns of a fit.
struct ProcessingUnknown {
  enum Index { log_blur, chroma_variance, saturation, sharpening, log_radius, log_mosaic, chroma_shift_px };
};
inline constexpr int processing_unknowns = 7;
using ProcessingVector = Eigen::Matrix<double, processing_unknowns, 1>;
PictureProcessing processing_of(const ProcessingVector& unknowns);

/// The light across one boundary: where it is [px from the middle sample], b, g, r of both sides as they would be shown
/// were nothing clipped, and by which share light grows along the normal [1/px].
using EdgeVector = Eigen::Matrix<double, 8, 1>;
inline constexpr int edge_unknowns = EdgeVector::RowsAtCompileTime;
inline constexpr int edge_offset = 0, edge_before = 1, edge_after = 4, edge_gradient = 7;

/// Samples of a channel, a pixel apart, then those of the next; rows beyond the samples fill a register.
inline constexpr int of_register = 4, edge_rows = (PooledEdge::samples + of_register - 1) / of_register * of_register,
                     all_edge_rows = 3 * edge_rows;
using EdgeSamples = Eigen::Matrix<float, all_edge_rows, 1>;

// Filters of encoded values, symmetric: the taps from the middle on, a pixel apart. One of an unsharp mask or of
// chroma's blur reaches 4 px, both together 8.
inline constexpr int filter_reach = 4, both_filters_reach = 2 * filter_reach;
using Filter = Eigen::Array<double, filter_reach + 1, 1>;
using BothFilters = Eigen::Array<double, both_filters_reach + 1, 1>;

/// The effect of the processing on encoded luma and on colour differences, and with `derivatives` how that changes.
struct ProcessingFilters {
  PictureProcessing processing;
  Filter luma, luma_by_sharpening, luma_by_radius;
  BothFilters chroma, chroma_by_sharpening, chroma_by_radius, chroma_by_variance;

  ProcessingFilters(const PictureProcessing& processing, bool derivatives);
};

/// A value's light, or a light's value; with its slope.
struct Encoding {
  float y, slope;
};
/// For any value, linear between those of the table.
Encoding light_at(const LightTable& table, double value);

/// A camera's image of a step of light.
EdgeSamples processed_edge(const LightTable& light_of_value, const ProcessingFilters& filters, const EdgeVector& edge);

/// And its derivatives by the processing and by the edge; `filters` have theirs.
struct LinearisedEdge {
  EdgeSamples values;
  Eigen::Matrix<float, all_edge_rows, processing_unknowns + edge_unknowns> jacobian;
};
LinearisedEdge linearised_edge(const LightTable& light_of_value, const ProcessingFilters& filters,
                               const EdgeVector& edge);

/// Light along a line, a pixel apart, as it looks after blurred colour differences in their place and sharpening. Light
/// that does not vary stays as it is, so light is as the camera shows it: `saturation` has been at work. With
/// `as_grey`, without colour differences: what a grey image of it shows, in all channels alike.
std::vector<std::array<double, 3>> filtered_light(const LightTable& light_of_value, const PictureProcessing& processing,
                                                  std::span<const std::array<double, 3>> light, bool as_grey);

}  // namespace lapservo::internal
