#pragma once

#include <filesystem>
#include <string>

#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// The shortest text that reads back as the same number, by YAML 1.1 as well: 4.0e-05, as 4e-05 is a text there.
std::string yaml_number(double number);

/// The rig as YAML that parse_rig() reads back to the last bit. With the file that it is written to, a camera_file is
/// named so that it is found from there, links by their own names; else the camera stands in the rig itself.
std::string rig_yaml(const Rig& rig, const std::filesystem::path& destination = {});

/// The same of a rig that was measured. Throws InputError naming the file where parse_rig() would not take it.
std::string measured_rig_yaml(const Rig& rig, const std::filesystem::path& destination);

/// Throws InputError where a rig would replace the file of a camera or a tool, which rigs may name.
void refuse_rig_over_part(const std::filesystem::path& destination);

/// Throws InputError where a rig would be replaced by `part`, a part of one.
void refuse_part_over_rig(const std::filesystem::path& destination, const std::string& part);

/// The lines of a camera file, or of a rig's `camera`, each after so many spaces.
std::string camera_yaml(const Camera& camera, int indent = 0);

/// The lines of a rig's `marker`, each after so many spaces.
std::string marker_yaml(const Marker& marker, int indent);

}  // namespace lapservo::internal
