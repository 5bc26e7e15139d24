#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "lapservo/calibration/check/rig_check.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// One standard deviation of the roll about the shaft, over the image at one depth.
struct SigmaMap {
  static constexpr int columns = 7, rows = 5;
  double depth_m = 0;  ///< of the marker's middle
  static constexpr std::size_t cells = static_cast<std::size_t>(columns) * rows;
  /// By row, the median over three rotations, of which one that is not found counts as the largest; empty where the
  /// marker is not wholly in view or is not found.
  std::array<std::optional<double>, cells> sigma_rad{};
  /// Where it is in view, but at most of the rotations not found.
  std::array<bool, cells> lost{};
};

/// A rig with its marker at a place, and the camera's estimate of it.
struct MeasuredSigma {
  Rigid3 camera_from_unrolled;
  double psi_rad = 0, sigma_rad = 0;
};

/// Sigmas as the tracker's fit has them on rendered frames, of shafts that come from the rig's RCM (or, without
/// camera_from_rcm, run like `measured`), times what the measured ones have over renderings of the same places: their
/// light, noise and blur. `measured`: at least one.
std::vector<SigmaMap> sigma_maps(const Rig& rig, std::size_t instrument, const std::vector<double>& depths_m,
                                 const std::vector<MeasuredSigma>& measured);

/// The view that the rig has of its work space: maps at the near and the far end of where the marker was, and both
/// taken together. Empty where no frame is measured.
struct WorkSpaceSurvey {
  std::vector<SigmaMap> maps;
  std::optional<WorkSpace> work_space;
};
WorkSpaceSurvey survey_work_space(const Rig& rig, std::size_t instrument, const RigEvidence& evidence);

}  // namespace lapservo::internal
