#pragma once

#include <string>
#include <vector>

#include "lapservo/rig/rig.h"
#include "lapservo/servo/sighting_fit.h"

namespace lapservo::internal {

/// The best explanation of a disagreement between joints and images.
struct Explanation {
  enum class Cause {
    unknown,       ///< the data do not determine it
    none,          ///< they agree
    moved,         ///< the endoscope, after they agreed
    sign,          ///< the rig: of one joint, from the start
    offset,        ///< the rig: of one joint, from the start
    registration,  ///< the rig: camera_from_rcm, from the start
    rig,           ///< one of these three, from the start; the data do not determine which
  };
  Cause cause = Cause::unknown;
  int joint = 0;  ///< of sign and offset: theta, phi, rho, psi

  bool is_of_the_rig() const { return cause >= Cause::sign; }
  /// With the remedy, in one line; empty unless is_of_the_rig().
  std::string text(const Instrument& instrument) const;
};

/// Compares hypotheses by their evidence (Laplace's approximation): the rig is right; one joint's sign or offset is
/// wrong; camera_from_rcm is wrong; camera_from_rcm changed at some time. Small errors of all numbers and of the
/// images' delay are allowed in each, so that a cause is named only where these do not suffice and where no other
/// explains the data nearly as well. `seen` in order of time; the instrument needs camera_from_rcm.
Explanation explain_disagreement(const std::vector<MarkerSighting>& seen, const Instrument& instrument);

}  // namespace lapservo::internal
