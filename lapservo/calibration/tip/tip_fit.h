#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lapservo/calibration/registration/timed_pose.h"
#include "lapservo/marker/marker.h"
#include "lapservo/tool/tool.h"

namespace lapservo::internal {

/// A marker while its tip is at a point.
struct TipSighting {
  TimedPose pose;
  std::vector<double> wrist_rad{};  ///< readings of the tool's wrist
  /// Nullopt: a dimple, the same in all sightings.
  std::optional<Eigen::Vector3d> point_in_camera_m{};
};

struct TipCalibration {
  /// Why there is none, and what to do about it: then nothing else counts. Empty when there is one.
  std::string refusal{};
  Tool tool{};                     ///< in its place
  bool with_offsets = false;       ///< the azimuth of the wrist and its joints' offsets were measured, too
  double sigma_m = 0;              ///< of the tip, in the direction in which it is known worst
  std::vector<double> misses_m{};  ///< of the tip from its point, by sighting
  double noise = 0;                ///< how many times their sigmas they are; robust
  std::string fault{};             ///< that shows beyond the noise: the covariance counts it. Empty without one
};

/// From poses of a marker whose tip rests in a dimple while the shaft turns about it, with constant readings of the
/// wrist. Errors of the poses are alike over a second.
TipCalibration pivoted_tip(const Tool& tool, const std::vector<double>& wrist_rad, const std::vector<TimedPose>& poses);

/// The same at the mean of the sightings' readings. Refused where a joint is farther from it than sigma_reading_rad.
TipCalibration pivoted_tip(const Tool& tool, const std::vector<TipSighting>& sightings);

/// From touches of points that lie still, in the order of `names`: five or more. A tip stands on its point to 0.1 mm. A
/// wrist that is bent alike in all of them is placed at the mean of its readings.
TipCalibration touched_tip(const Tool& tool, const std::vector<TipSighting>& touches,
                           const std::vector<std::string>& names);

/// The tool so placed that at these readings of its wrist its tip lies there. The base's azimuth and the joints'
/// offsets stay as they are known, or unknown: of a tip that is measured at other readings the covariance counts them.
Tool placed_by_tip(Tool tool, const std::vector<double>& wrist_rad, const Eigen::Vector3d& tip_in_marker_m,
                   const Eigen::Matrix3d& covariance_m2);

/// The tool with its base, the tip of a straight one, on the shaft's axis, so far from the marker's distal edge.
Tool placed_by_calliper(Tool tool, const Marker& marker, double distance_m, double sigma_m);

/// Standard deviation of a base's place across the shaft's axis, where nothing else is known: film, glue, play.
inline constexpr double off_axis_sigma_m = 0.1e-3;

}  // namespace lapservo::internal
