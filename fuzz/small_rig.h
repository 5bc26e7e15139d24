#pragma once

#include "lapservo/rig/rig.h"

namespace lapservo::fuzz {

/// Two instruments before a camera of 160x120: small enough for thousands of frames a minute. The RCM lies 100 mm left
/// of the camera's axis, at the depth of the work space; q = [0, pi/2, rho, psi] points to the right across the image.
inline Rig small_rig(bool registered, bool distorted) {
  Rig rig;
  rig.camera = {.width_px = 160, .height_px = 120, .fx_px = 250, .fy_px = 250, .cx_px = 79.5, .cy_px = 59.5};
  if (distorted) rig.camera.distortion = {-0.2, 0.05, 1e-3, -1e-3, 0};
  Marker marker;
  marker.diameter_m = 0.0084;
  marker.bands_upper_m = {0.0035, 0.0035, 0.017};
  marker.bands_lower_m = {0.0095, 0.0095, 0.005};
  for (const auto& hues_deg : {std::array{90.0, 180.0, 270.0}, std::array{180.0, 90.0, 270.0}}) {
    Instrument instrument;
    instrument.name = rig.instruments.empty() ? "PSM1" : "PSM2";
    instrument.marker = marker;
    instrument.marker.hues_deg = hues_deg;
    if (registered) instrument.camera_from_rcm = Rigid3{Eigen::Quaterniond::Identity(), {-0.1, 0, 0.1}};
    rig.instruments.push_back(instrument);
  }
  return rig;
}

}  // namespace lapservo::fuzz
