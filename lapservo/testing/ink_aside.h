#pragma once

#include "lapservo/marker/marker.h"

namespace lapservo::scenes {

/// A print whose inks were not laid one on the other: the middle band lies aside as a whole.
inline Marker with_ink_aside(Marker marker, double aside_m) {
  for (auto* bands_m : {&marker.bands_upper_m, &marker.bands_lower_m})
    (*bands_m)[0] += aside_m, (*bands_m)[2] -= aside_m;
  return marker;
}

}  // namespace lapservo::scenes
