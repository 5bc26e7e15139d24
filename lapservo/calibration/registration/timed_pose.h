#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <Eigen/Geometry>

#include "lapservo/vision/observation.h"

namespace lapservo::internal {

/// A marker's pose by one frame alone, without an RCM; `time_s` is the frame's stamp.
struct TimedPose {
  double time_s = 0;
  Observation::MarkerPose marker;

  /// The change of the frame's pose per unit of focal length, to first order: the motion of the origin and the rotation
  /// of the marker, in the camera frame. Zero where it was not requested.
  struct ByFocal {
    Eigen::Vector3d origin_m = Eigen::Vector3d::Zero(), turn_rad = Eigen::Vector3d::Zero();
  };
  ByFocal by_focal = {};

  Eigen::Vector3d origin() const { return marker.camera_from_marker.translation; }  ///< in the camera frame
  Eigen::Vector3d axis() const { return marker.camera_from_marker.rotation * Eigen::Vector3d::UnitZ(); }
  /// How far the axis passes a point in the camera frame, and how far along the axis the origin lies from there.
  double miss_m(const Eigen::Vector3d& point_m) const { return (origin() - point_m).cross(axis()).norm(); }
  double beyond_m(const Eigen::Vector3d& point_m) const { return (origin() - point_m).dot(axis()); }
};

/// Describes a marker whose axis points back to the RCM, and the remedy.
inline constexpr auto reversed_marker =
    "the marker points away from the tip: it is mounted the wrong way round; its proximal end (band 0) belongs to the "
    "trocar";

/// How many poses there are in a second: over about as many, what is wrong with them stays alike.
inline std::size_t poses_per_second(const std::vector<TimedPose>& poses) {
  const double span_s = poses.empty() ? 0 : poses.back().time_s - poses.front().time_s;
  return span_s > 0 ? static_cast<std::size_t>(std::clamp(static_cast<double>(poses.size()) / span_s, 1.0, 120.0)) : 1;
}

}  // namespace lapservo::internal
