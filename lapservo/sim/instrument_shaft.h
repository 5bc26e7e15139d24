#pragma once

#include <vector>

#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/rig.h"
#include "lapservo/sim/scene.h"

namespace lapservo::internal {

/// An instrument's shaft with its marker, clean.
inline ShaftModel shaft_of(const Instrument& instrument) {
  ShaftModel shaft;
  shaft.marker = instrument.marker;
  return shaft;
}

/// One an instrument, in the rig's order.
inline std::vector<ShaftModel> shafts_of(const Rig& rig) {
  std::vector<ShaftModel> shafts;
  for (const Instrument& instrument : rig.instruments) shafts.push_back(shaft_of(instrument));
  return shafts;
}

/// Where it is at a configuration. Throws std::bad_optional_access when the instrument has no camera_from_rcm.
inline ShaftPlacement placement_of(const Instrument& instrument, const JointVector& q) {
  return {instrument.camera_from_rcm.value() * rcm_from_unrolled(q), q.psi_rad};
}

}  // namespace lapservo::internal
