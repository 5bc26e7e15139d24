#pragma once

#include <string>

#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// The rig as YAML that parse_rig() reads back to the last bit, its camera included, whatever files it came from.
std::string rig_yaml(const Rig& rig);

/// The lines of a rig's `marker`, each after so many spaces.
std::string marker_yaml(const Marker& marker, int indent);

}  // namespace lapservo::internal
