#pragma once

#include <array>
#include <optional>
#include <span>

#include "lapservo/vision/camera/pooled_edges.h"
#include "lapservo/vision/camera/processed_edge.h"

namespace lapservo::internal {

/// When a camera's processing counts.
struct ProcessingLimits {
  /// By accuracy_study camera 12 3, 69 first guesses of 72 frames without any (none, bayer, ca, crosstalk, rec709,
  /// vignette) lie below these sizes, and of 60 with it (sharpen, chroma420, tone, camera, jpeg) none.
  double chroma_variance_px2 = 0.5, max_sharpening = 0.3, min_sharpening = -0.2, saturation = 0.1;
  double max_blur_px = 1.65;  ///< beyond, motion and defocus are taken for processing, and flat parts are out of reach
  /// Of a value, and of what is left without any processing: blood, highlights and noise are not explained by it (0.87
  /// and more), processing is (0.2 to 0.7).
  double max_misfit = 0.013, max_misfit_fraction = 0.8;
  /// Images that no processing explains so well have none: 0.002 to 0.006 are left of rendered frames without any (a
  /// response that is Rec. 709's and not the rig's among them, which saturation would explain, wrongly), 0.0035 and
  /// more of those with some. Processing that is taken for none by this is small, and sigma holds (0.3 to 0.9).
  double max_misfit_of_none = 0.0048;
  int min_boundaries = 3;
};
inline constexpr ProcessingLimits processing_limits;

/// Expectations of an image before it is seen. Below 0 `least_sharpening` is a blur of luma after the response.
struct ExpectedPicture {
  double least_sharpening = -0.35;
  double gradient_sigma_per_px = 0.01;  ///< of the share by which light grows along a boundary's normal
  bool only_video = false;  ///< nothing but blurred colour differences: as demosaiced, as sharp, as colourful
};

/// The part of a frame's processing that matters to its boundaries.
struct ProcessedEdges {
  PictureProcessing processing;
  std::array<std::optional<double>, 4> bias_px;  ///< by which locate_edges mislocates each boundary that was seen well
  /// And each measurement of one, by those that are as bright: what the processing does to an edge goes by its light.
  std::array<float, EdgeMeasurements::most> measurement_bias_px{};
  bool clips = false;  ///< colours beside a boundary lie beyond black or white: what is visible of them shows less
  double misfit = 0;   ///< rms of what the model leaves of the values
  double misfit_without = 0;  ///< and of what one without any processing does
};

/// Whether a first guess is more than nothing seen through noise.
bool is_processed(const PictureProcessing& processing);

/// A first guess at the processing, for a fifth of the time. Nullopt when too little was seen.
std::optional<PictureProcessing> first_guess(const LightTable& light_of_value, const PooledEdges& edges,
                                             double blur_px);

/// The likeliest processing, from what all boundaries look like; such as is expected. `blur_px` is what locate_edges
/// was given. Nullopt when too little was seen.
std::optional<ProcessedEdges> explain(const LightTable& light_of_value, const PooledEdges& edges, double blur_px,
                                      const ExpectedPicture& expected = {});

/// Whether the frame looks like that rather than like none.
bool is_believed(const ProcessedEdges& edges);

/// Whether the camera did more to an image than its response says. Unknown where the image can't show it: blurred
/// widely, too little seen, or unlike any processing that is known here.
enum class Processing { unknown, none, found };
struct ProcessingEvidence {
  Processing processing = Processing::unknown;
  std::optional<ProcessedEdges> edges;  ///< when found
  bool explained = false;               ///< it took more than a first guess
};

/// For the boundaries among `measurements`, which locate_edges located with `blur_px`.
ProcessingEvidence find_processing(const LightImage& light, std::span<const Measurement> measurements, double blur_px,
                                   const ExpectedPicture& expected = {});

}  // namespace lapservo::internal
