#pragma once

#include <Eigen/Core>

#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/rig.h"
#include "lapservo/sim/renderer.h"

/// Instruments that move while the shutter is open. For tests.
namespace lapservo::scenes {

/// The moving part during an exposure, and its motion.
struct Motion {
  Eigen::Vector2d along_and_across_px =
      Eigen::Vector2d::Zero();  ///< of the marker's middle, along the shaft and across
  double turn_rad = 0;          ///< about the shaft
  bool from_rest = false;       ///< with constant acceleration; else even
};

/// The first instrument's exposure with `q` in the middle of it.
Exposure moving_exposure(const Rig& rig, const JointVector& q, const Motion& motion);

/// Its image before tissue.
cv::Mat render_moving(const Rig& rig, const JointVector& q, const Motion& motion);

}  // namespace lapservo::scenes
