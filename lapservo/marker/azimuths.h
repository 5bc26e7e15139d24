#pragma once

#include "lapservo/marker/marker.h"

namespace lapservo::internal {

/// tau, unwrapped, at an azimuth of the unrolled frame on an instrument that is turned by psi (docs/frames.md,
/// "What the centre line shows").
inline double marker_azimuth_rad(const Marker& marker, double azimuth_rad, double psi_rad) {
  return azimuth_rad - psi_rad - marker.seam_rad;
}

/// psi, unwrapped, of an instrument that shows tau at an azimuth of the unrolled frame.
inline double rotation_rad(const Marker& marker, double azimuth_rad, double tau_rad) {
  return azimuth_rad - tau_rad - marker.seam_rad;
}

}  // namespace lapservo::internal
