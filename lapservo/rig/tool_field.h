#pragma once

#include <filesystem>

#include "lapservo/core/yaml_field.h"
#include "lapservo/tool/tool.h"

namespace lapservo::internal {

/// An instrument's `tool` (docs/rig.md); `folder` is where its file is looked for. Throws InputError.
Tool parse_tool(const YamlField& field, const std::filesystem::path& folder);

}  // namespace lapservo::internal
