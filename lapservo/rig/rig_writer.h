#pragma once

#include <array>
#include <string>

#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// The rig as YAML that parse_rig() reads back to the last bit, its camera included, whatever files it came from.
std::string rig_yaml(const Rig& rig);

/// One standard deviation of each number of a camera, in its units; 0 for what was not measured.
struct CameraSigmas {
  double fx_px = 0, fy_px = 0, cx_px = 0, cy_px = 0;
  std::array<double, 5> distortion{};
  double blue = 0, red = 0;  ///< of the lateral chromatic aberration
  double response = 0;       ///< of encoded values (0 to 1); 0: was not measured, and is not written
};

/// The lines of a rig's `camera`, or of a camera file, with one standard deviation of each number.
std::string measured_camera_yaml(const Camera& camera, const CameraSigmas& sigmas);

/// What stands for it in a rig's `camera`.
std::string response_yaml(const Response& response);

/// The lines of a rig's `marker`, each after so many spaces.
std::string marker_yaml(const Marker& marker, int indent);

}  // namespace lapservo::internal
