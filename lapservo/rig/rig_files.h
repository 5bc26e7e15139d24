#pragma once

#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// `use` of each path that a rig names: the camera's file and the tools'.
template <typename AnyRig, typename Use>
void each_file(AnyRig& rig, const Use& use) {
  if (!rig.camera_file.empty()) use(rig.camera_file);
  for (auto& instrument : rig.instruments)
    if (instrument.tool && !instrument.tool->file.empty()) use(instrument.tool->file);
}

}  // namespace lapservo::internal
