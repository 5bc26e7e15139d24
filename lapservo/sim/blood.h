#pragma once

#include <vector>

#include "lapservo/core/random.h"
#include "lapservo/sim/scene.h"

namespace lapservo::internal {

/// Discs of blood over about a fraction of a print, 0 to 0.9: a fifth of what they add up to lies on one another.
std::vector<Blotch> blood_over(const Marker& marker, double fraction, Random& random);

}  // namespace lapservo::internal
