#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "lapservo/geometry/camera.h"
#include "lapservo/marker/marker.h"
#include "lapservo/rig/rig_writer.h"

namespace lapservo::internal {

/// The rig file `path` as YAML with another marker for one instrument, for a file at `destination`: every other entry
/// stays as it is written there, sigmas included; comments do not. A camera file is named so that it is found from
/// there. The rig must have been read without complaint (load_rig).
std::string updated_rig_yaml(const std::filesystem::path& path, const std::filesystem::path& destination,
                             std::size_t instrument, const Marker& marker);

/// The same with another camera, which stands in the rig itself whatever file the old one came from.
std::string updated_rig_yaml(const std::filesystem::path& path, const Camera& camera, const CameraSigmas& sigmas);

}  // namespace lapservo::internal
