#pragma once

#include <optional>

#include <Eigen/Core>

#include "lapservo/geometry/camera.h"
#include "lapservo/marker/marker.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// When the middle of the marker is exposed, after the frame's time.
double exposed_after_s(const Camera& camera, const Marker& marker, const ShaftPose& pose);

/// Where the marker was when it was exposed in the frame before, and how it came there.
struct PoseBefore {
  PoseUnknowns unknowns;
  double time_s;                         ///< of that exposure, after the frame's time that it is compared with
  PoseVector step = PoseVector::Zero();  ///< of the unknowns, that led there
  double step_s = 0;                     ///< which took so long; 0 where nothing was seen before
};

/// How a rolling shutter shows a marker that moves: a row that is exposed later shows it farther on. A pose is that of
/// the time when the marker's middle is exposed.
class RowMotion {
 public:
  /// No motion, as a global shutter shows it.
  RowMotion() = default;
  RowMotion(const Camera& camera, const Marker& marker, const PoseUnknowns& now, const PoseBefore& before);

  /// By how much a point at `raw_px` of the pose is shown farther on along `normal`; `row` is d(its position along the
  /// normal)/d(unknowns) [px].
  double shift_px(const UnknownVector& row, const Eigen::Vector2d& raw_px, const Eigen::Vector2d& normal) const;
  /// The change of the unknowns from the exposure of the marker's middle to the frame's time; and its uncertainty, at
  /// least as much as the rate's change over the last two frames makes of it. Nullopt where that is not known.
  const PoseVector& to_frame() const { return to_frame_; }
  const std::optional<PoseVector>& to_frame_sigma() const { return to_frame_sigma_; }

 private:
  PoseVector by_row_ = PoseVector::Zero(), to_frame_ = PoseVector::Zero();
  std::optional<PoseVector> to_frame_sigma_;
  double middle_row_px_ = 0;
};

}  // namespace lapservo::internal
