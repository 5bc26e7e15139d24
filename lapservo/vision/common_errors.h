#pragma once

#include <array>
#include <optional>

#include "lapservo/vision/edge_blur.h"
#include "lapservo/vision/edge_measurements.h"
#include "lapservo/vision/picture_processing.h"
#include "lapservo/vision/print_doubt.h"
#include "lapservo/vision/residual_lines.h"

namespace lapservo::internal {

/// Errors that all measurements of a group share (one sigma), by how much all noise is larger than each measurement
/// says, and what is doubted before the print is blamed.
struct CommonErrors {
  std::array<double, measurement_groups> px{};
  /// Of all boundaries alike (rms): moved along the shaft, leaning from side to side, bowed.
  double whole_px = 0, leaning_px = 0, bowed_px = 0;
  double noise_scale = 1;
  /// And what of all that is told of the pose, once the print was judged: what a group shares, and, 1 or less, by how
  /// much noise is smaller.
  std::array<double, measurement_groups> told_px{};
  double told_noise_scale = 1;
  PrintDoubt doubt;
  double inner_doubt_scale = 1;  ///< by how much larger still noise is taken for PrintFit::inner_off_m
};

/// By how much noise is to be taken larger before a print is blamed: compression, motion blur and a camera's processing
/// move edges of this sigma, which were blurred by this and moved by this.
double doubt_scale(double sigma_px, double blur_px, double bias_px);

/// What each boundary and side as a whole may be off, and the noise as it is. `bias_px`: by how much the camera's
/// processing may have moved each boundary; of those that `processed` tells, it is corrected. `departure_px`: what is
/// left of a departure from the rig's camera.
CommonErrors common_errors(const EdgeMeasurements& pass, const ResidualLines& lines, const EdgeBlur& blur,
                           const std::optional<ProcessedEdges>& processed, const std::array<double, 4>& bias_px,
                           const std::array<double, 4>& departure_px);

}  // namespace lapservo::internal
