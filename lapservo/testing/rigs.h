#pragma once

#include "lapservo/core/random.h"
#include "lapservo/geometry/rotation.h"
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

inline Eigen::Vector3d random_direction(internal::Random& random) {
  return Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
}

/// The first instrument's registration off by 1 mm and 5 mrad, times the scale.
inline Rig misregistered(Rig rig, internal::Random& random, double scale = 1) {
  Rigid3& camera_from_rcm = *rig.instruments[0].camera_from_rcm;
  camera_from_rcm.translation += scale * 1e-3 * random_direction(random);
  camera_from_rcm.rotation = internal::rotation_by(scale * 5e-3 * random_direction(random)) * camera_from_rcm.rotation;
  return rig;
}

}  // namespace lapservo::testing
