#pragma once

#include <vector>

#include "lapservo/control/image_measurement.h"
#include "lapservo/stream/image_stream.h"
#include "lapservo/vision/observation.h"

namespace lapservo {

/// An image and what was seen in it.
struct TrackedImage {
  StampedImage image;
  std::vector<Observation> observations;  ///< one an instrument of the rig
  ImageMeasurement measurement;           ///< of the rig's first instrument
  std::optional<Rigid3> camera_from_rcm;  ///< of that instrument, as it was tracked with
  Rigid3 first_from_camera{};             ///< EndoscopePose's at its exposure, where there is one
};

enum class TrackingThread {
  callers,  ///< the loop's: what a simulation wants, in which no time passes meanwhile
  own,      ///< the loop never waits for vision: what a real arm wants
};

}  // namespace lapservo
