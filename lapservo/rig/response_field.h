#pragma once

#include "lapservo/core/yaml_field.h"
#include "lapservo/geometry/response.h"

namespace lapservo::internal {

/// A camera's `response` (docs/rig.md): srgb, rec709, linear, gamma:VALUE or a table; srgb when it
/// is missing.
Response parse_response(const YamlField& field);

}  // namespace lapservo::internal
