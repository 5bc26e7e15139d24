#pragma once

#include <optional>

#include "lapservo/geometry/rigid3.h"

namespace lapservo {

/// The port to what holds an endoscope that moves while the loop runs. Called by several threads at the same time.
class EndoscopePose {
 public:
  virtual ~EndoscopePose() = default;
  /// first_from_camera: from the camera's frame at a time on the loop's clock to that of the time when camera_from_rcm
  /// held. Times to come within 0.1 s are extrapolated. nullopt where it is not known.
  virtual std::optional<Rigid3> first_from_camera(double time_s) const = 0;
};

}  // namespace lapservo
