#pragma once

#include <span>

#include "lapservo/vision/camera/camera_departure.h"
#include "lapservo/vision/camera/picture_processing.h"
#include "lapservo/vision/edges/edge_measurements.h"
#include "lapservo/vision/image/light_image.h"

namespace lapservo::internal {

/// The camera's processing of an image, as it looks when what is known of the camera is undone; and its departure from
/// the rig's, as far as it is known then.
struct SeenCamera {
  ProcessingEvidence evidence = {};
  CameraDeparture departure = {};
  int explained = 0, asked_for_departure = 0;  ///< so often
};

/// By the boundaries among `measurements`, which fit_step located with `blur_px` in what `light` is through the `known`
/// departure. One is accepted if the image looks unprocessed without it: processing moves channels apart, too. One that
/// an earlier frame showed is withdrawn by an image that looks better with it in.
SeenCamera look_at_camera(const LightImage& light, std::span<const Measurement> measurements, double blur_px,
                          const CameraDeparture& known);

}  // namespace lapservo::internal
