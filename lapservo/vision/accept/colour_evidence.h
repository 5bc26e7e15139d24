#pragma once

#include <cstddef>

#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

// What pixels' colours say of a fit that would be refused without.

/// On how many of so many lines along the marker nothing hides a boundary: colours of the marker, whichever, show on
/// both sides, of an end inside.
int lines_in_clear_view(const Scene& scene, const ShaftPose& pose, std::size_t boundary, int lines);

/// Of the ring beyond an end, the fraction with that end's colour, of both ends the larger; what shows it in patches,
/// since noise in the dark does in single pixels.
double spilled_in_patches(const Scene& scene, const ShaftPose& pose);

}  // namespace lapservo::internal
