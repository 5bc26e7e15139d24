#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "lapservo/geometry/rigid3.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// The joints as the rig reads them and the marker as one image shows it, without the registration.
struct JointsAndMarker {
  double time_s = 0;
  Eigen::Vector4d q = Eigen::Vector4d::Zero(), rate = Eigen::Vector4d::Zero();  ///< rad, m, and per second
  Rigid3 camera_from_marker;
};

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
Explanation explain_disagreement(const std::vector<JointsAndMarker>& seen, const Instrument& instrument);

}  // namespace lapservo::internal
