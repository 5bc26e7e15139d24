#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "lapservo/calibration/check/rig_check.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

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

/// The view that the rig has of its work space. Nullopt where no frame is measured.
std::optional<WorkSpace> survey_work_space(const Rig& rig, std::size_t instrument, const RigEvidence& evidence);

}  // namespace lapservo::internal
