#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/rig.h"
#include "lapservo/sim/scene.h"

namespace lapservo::internal {

/// An instrument's shaft with its marker, clean, and its tool where the rig says where that is. The shaft ends where
/// the wrist begins, or on a third of the way to the tip of a straight tool that is short.
inline ShaftModel shaft_of(const Instrument& instrument) {
  ShaftModel shaft;
  shaft.marker = instrument.marker;
  if (!instrument.tool || !instrument.tool->place) return shaft;
  shaft.tool = instrument.tool;
  const double beyond_m = std::max(0.0, instrument.tool->place->base_in_marker_m.z() - instrument.marker.length_m());
  shaft.shaft_beyond_m = instrument.tool->wrist.empty() ? std::min(shaft.shaft_beyond_m, beyond_m / 3) : beyond_m;
  return shaft;
}

/// One an instrument, in the rig's order.
inline std::vector<ShaftModel> shafts_of(const Rig& rig) {
  std::vector<ShaftModel> shafts;
  for (const Instrument& instrument : rig.instruments) shafts.push_back(shaft_of(instrument));
  return shafts;
}

/// Where it is at a configuration. Throws std::bad_optional_access when the instrument has no camera_from_rcm.
inline ShaftPlacement placement_of(const Instrument& instrument, const JointVector& q,
                                   std::vector<double> wrist_rad = {}) {
  return {instrument.camera_from_rcm.value() * rcm_from_unrolled(q), q.psi_rad, false, std::move(wrist_rad)};
}

}  // namespace lapservo::internal
