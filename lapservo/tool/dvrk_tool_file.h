#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "lapservo/tool/tool.h"

namespace lapservo::internal {

/// The wrist of a dVRK tool file (share/tool/*.json of sawIntuitiveResearchKit), without a place: its joints after
/// `roll` and its tooltip_offset (tooltip-offset before dVRK 2.4), without which it is refused. Its coupling is that of
/// motors to joints, which measured_js has behind it. Throws InputError naming file, field, value and what was
/// expected.
Tool read_dvrk_tool(const std::filesystem::path& path);

/// The same from text; `source` stands for the file's name in errors.
Tool parse_dvrk_tool(std::string_view json, const std::string& source);

/// That the tip of a tool with such a file is a point on the axis of its last joint, where most of them end, and not
/// the end of its jaw, with the key of a rig that moves it; empty for other tools.
std::string axis_tip_text(const Tool& tool);

}  // namespace lapservo::internal
