#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lapservo/calibration/registration/timed_pose.h"
#include "lapservo/tool/tool.h"

namespace lapservo::internal {

/// A marker while its tip is at a point.
struct TipSighting {
  TimedPose pose;
  std::vector<double> wrist_rad{};  ///< readings of the tool's wrist
  /// Nullopt: a dimple, the same in all sightings.
  std::optional<Eigen::Vector3d> point_in_camera_m{};
};

/// Something that a fit leaves out: it moves the points, camera frame.
struct TipFault {
  std::string what, remedy;
  std::vector<Eigen::Matrix3Xd> moves;  ///< a matrix a component, of a size of 1 m at the tip; a column a sighting
};

/// One way to measure a tip, beside its sightings.
struct TipWay {
  std::vector<TipFault> faults;
  double sigma_point_m = 0;         ///< of each point by itself
  double unmodelled_sigmas = 1;     ///< see frame_fit.h
  std::size_t alike_sightings = 1;  ///< over so many errors are alike
  std::string to_mend, to_do;       ///< against a misfit that nothing explains, and for a tip that is left open
};

struct TipCalibration {
  /// Why there is none, and what to do about it: then nothing else counts. Empty when there is one.
  std::string refusal;
  Tool tool;                     ///< in its place
  bool with_offsets = false;     ///< the azimuth of the wrist and its joints' offsets were measured, too
  double sigma_m = 0;            ///< of the tip, in the direction in which it is known worst
  std::vector<double> misses_m;  ///< of the tip from its point, by sighting
  double noise = 0;              ///< how many times their sigmas they are; robust
  std::string fault;             ///< that shows beyond the noise: the covariance counts it. Empty without one
};

/// The place of a tool whose tip was at points (Ceres, Cauchy loss). Half of a pose's error is common to all. A wrist
/// that is bent differently in the sightings shows its azimuth and its joints' offsets, which the tool's own sigmas
/// bound. Refused where the tip is left open, or misses its points by more than a tip may be off.
TipCalibration fit_tip(const Tool& tool, const std::vector<TipSighting>& sightings, const TipWay& way);

}  // namespace lapservo::internal
