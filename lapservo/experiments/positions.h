#pragma once

#include <vector>

#include "lapservo/core/random.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// Random configurations of the rig's first instrument (psi too), spread over the field of view and over depths of 60
/// to 130 mm: each is the one of a handful whose marker lies farthest from all before it (Mitchell's best candidate).
/// The whole visible side of the marker lies in the image, 30 px or more from its border, and the shaft leans at most
/// 20 degrees towards or away from the camera. Throws InputError when that is hardly ever so.
std::vector<JointVector> spread_positions(const Rig& rig, int count, Random& random);

/// Image of the middle of the marker on the centre line, raw pixels.
Eigen::Vector2d marker_middle_px(const Camera& camera, const Instrument& instrument, const JointVector& q);

}  // namespace lapservo::internal
