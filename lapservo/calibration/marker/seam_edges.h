#pragma once

#include <optional>

#include "lapservo/vision/camera/picture_processing.h"
#include "lapservo/vision/image/light_image.h"
#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// How far one of the print's two edges at the seam lies from where a pose has it, around the shaft.
struct SeamEdge {
  UnknownVector row;  ///< d(position along `around` in the image)/d(unknowns) [px]
  double residual_px = 0, sigma_px = 0;
  double by_gap_px = 0;  ///< how it moves with gap_rad
};

/// The print's edges at tau = 0 and at its other end, where the image shows the corner itself: past one that is turned
/// away from the camera the film's cut edge is seen, whose light nobody knows.
struct SeamEdges {
  std::optional<SeamEdge> upper, lower;
  double gap_rad = 0, sigma_gap_rad = 0;  ///< as this view shows it alone
};

/// Fits light across the seam: one band, the bare shaft, another band, blurred; colours and shading are free. Looks up
/// to `reach_m` around the shaft from where pose and marker have the edges. Unless `free_gap`, the print's ends meet:
/// one edge, the upper. The effect of `processing` on the edges is taken off. `grey`: the image without colour
/// differences, to locate the edges in where those are blurred. Nullopt when the seam does not face the camera or has
/// no contrast.
std::optional<SeamEdges> measure_seam(const Scene& scene, const LightImage& light, const PoseUnknowns& unknowns,
                                      double blur_px, double reach_m, bool free_gap,
                                      const std::optional<PictureProcessing>& processing,
                                      const LightImage* grey = nullptr);

}  // namespace lapservo::internal
