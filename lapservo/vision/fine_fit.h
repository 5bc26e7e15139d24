#pragma once

#include <array>

#include "lapservo/vision/camera_departure.h"
#include "lapservo/vision/edge_measurements.h"
#include "lapservo/vision/light_image.h"
#include "lapservo/vision/picture_processing.h"
#include "lapservo/vision/print_fit.h"
#include "lapservo/vision/scene.h"
#include "lapservo/vision/shaft_pose.h"
#include "lapservo/vision/turn_blur.h"

namespace lapservo::internal {

struct FineFit {
  bool converged = false;
  PoseUnknowns unknowns;
  UnknownMatrix covariance;  ///< of the unknowns, one sigma squared
  EdgeBlur blur;
  int lines = 0;                         ///< generatrices looked at
  std::array<int, 4> used{};             ///< of them, lines on which the boundary was located and agrees with the fit
  std::array<int, 4> in_image{};         ///< lines on which the boundary lies inside the image and off the seam
  int sides_in_image = 0;                ///< places at which the shaft's sides were looked for
  int sides_used = 0;                    ///< of them, those at which the side was located and agrees with the fit
  double inlier_rms_sigmas = 0;          ///< of the boundaries' residuals, print errors taken out
  double print_off_probability = 0;      ///< that the print is off by more than the rig's tolerance
  double psi_variance = 0;               ///< by which picture and print are judged (print_fit.h)
  double psi_variance_by_tolerance = 0;  ///< of the covariance, what the rig's tolerance of the print adds
  double psi_variance_by_print = 0;      ///< and what the print adds beyond that
  double far_off_probability = 1;        ///< where many prints are off (print_fit.h)
  double psi_variance_suspected = 0;     ///< and what one that is suspicious adds (print_fit.h)
  double inner_off_m = 3;                ///< how far off an inner boundary of the print may lie (print_fit.h)
  Processing processing = Processing::unknown;  ///< as far as asked
  int processing_explained = 0;                 ///< how often ProcessingEvidence::explained
  int asked_for_departure = 0;                  ///< how often find_departure() was
  int passes = 0;                               ///< in which edges were located
  std::array<double, 4> bias_px{};              ///< by how much that may have moved each boundary
  CameraDeparture departure;                    ///< from the rig's camera, as far as known
  TurnBlur turn;                                ///< within the exposure, which the covariance knows nothing of

  /// Of the boundary points that the image could show, the fraction that was located.
  double located_fraction() const;
};

/// Whether to ask what the camera did to the picture beyond its response (picture_processing.h), which costs a tenth of
/// a tracked frame's time where it did nothing. It does the same in all frames: bias_px, an earlier frame's, is what a
/// frame that can't tell is in doubt by. `departure` is what earlier frames showed of the
/// camera.
struct ExpectedProcessing {
  bool ask = true;
  std::array<double, 4> bias_px{};
  CameraDeparture departure = {};
};

/// Fits the pose to all boundaries on all visible generatrices and to the shaft's sides, located to a fraction of a
/// pixel in linear light, with a robust loss. `start` must be good to some pixels.
FineFit fit_finely(const Scene& scene, const LightImage& light, const PoseUnknowns& start, EdgeBlur blur,
                   const ExpectedProcessing& expected = {});

}  // namespace lapservo::internal
