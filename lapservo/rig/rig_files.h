#pragma once

#include <filesystem>

#include "lapservo/geometry/camera.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// The camera of a file that a rig's `camera` may name. Throws InputError as load_rig().
Camera load_camera(const std::filesystem::path& path);

/// `use` of each path that a rig names: the camera's file and the tools'.
template <typename AnyRig, typename Use>
void each_file(AnyRig& rig, const Use& use) {
  if (!rig.camera_file.empty()) use(rig.camera_file);
  for (auto& instrument : rig.instruments)
    if (instrument.tool && !instrument.tool->file.empty()) use(instrument.tool->file);
}

}  // namespace lapservo::internal
