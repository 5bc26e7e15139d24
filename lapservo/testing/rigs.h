#pragma once

#include "lapservo/rig/rig.h"
#include "lapservo/testing/sample_frames.h"

namespace lapservo::testing {

/// configs/paper.yaml.
inline Rig paper_test_rig() {
  return load_rig(source_folder() / "configs" / "paper.yaml");
}

/// The same view on a camera of half the width and height: images cost a quarter.
inline Rig small_test_rig() {
  Rig rig = paper_test_rig();
  Camera& camera = rig.camera;
  camera.width_px /= 2, camera.height_px /= 2;
  camera.fx_px /= 2, camera.fy_px /= 2;
  camera.cx_px = (camera.width_px - 1) / 2.0, camera.cy_px = (camera.height_px - 1) / 2.0;
  return rig;
}

}  // namespace lapservo::testing
