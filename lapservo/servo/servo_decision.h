#pragma once

#include <optional>
#include <string>
#include <vector>

#include "lapservo/control/control_step.h"
#include "lapservo/control/image_measurement.h"
#include "lapservo/control/trajectory.h"
#include "lapservo/geometry/rigid3.h"
#include "lapservo/robot/robot.h"

namespace lapservo {

/// All that one step of the loop goes by.
struct ServoInput {
  double time_s = 0;
  JointState joints;
  std::optional<ImageMeasurement> image;  ///< the newest frame since the step before, if any
  DesiredFeatures desired;                ///< at time_s
  std::vector<JointReading> readings{};   ///< since the step before: Robot::readings()
};

/// The decision of one step.
struct ServoDecision {
  ControlStep control;
  /// Images show the marker well, but for some time nowhere where camera_from_rcm, lens and RCM agree on a
  /// configuration: one of them is wrong, r with it, by an unknown amount.
  bool registration_contradicted = false;
  /// Which camera_from_rcm the loop goes by: 0 the rig's, then one more whenever the endoscope moved and when the
  /// operator has started it with one that was measured anew. Images that were tracked with another one do not count.
  int registration = 0;
  std::optional<Rigid3> camera_from_rcm;  ///< nullopt until that start, and where the rig has none
  /// Of one that was measured anew: as Instrument::registration_covariance.
  std::optional<Eigen::Matrix<double, 6, 6>> registration_covariance;
  bool release = false;  ///< until that start the arm is the operator's: Robot::release()
  /// The fault and its remedy, in one line, where a person has to act; else empty. With HoldReason::wrong_rig: what
  /// of the rig explains best that joints and images have disagreed from the start.
  std::string remedy;
  bool send = false;  ///< the arm is to follow path(); else it is left alone and holds by itself
};

}  // namespace lapservo
