#pragma once

#include "lapservo/core/joint_vector.h"
#include "lapservo/robot/joint_path.h"
#include "lapservo/robot/operating_state.h"

namespace lapservo {

/// What an arm says of itself (CRTK measured_js and operating_state).
struct JointState {
  double time_s = 0;  ///< when the joints were read, on the loop's clock
  JointVector q;
  OperatingState operating_state = OperatingState::disabled;
};

/// The port to an arm. Both calls come from the loop's thread, once a control tick, and must return at once: what talks
/// to the arm (a driver, a transport) does so in a thread of its own.
///
/// What an implementation owes:
/// - It samples the last path sent at the arm's own rate. Where the path runs out because no newer one came, the path
///   itself brakes to rest (JointPath): go on sampling it.
/// - It forgets the path as soon as the arm is not enabled, so that nothing jumps when it is enabled again.
class Robot {
 public:
  virtual ~Robot() = default;
  /// The latest reading. Numbers that are not finite are allowed: the loop holds then.
  virtual JointState state() = 0;
  /// Follow this path from now on; it replaces the one before and goes on from it without a jump. To be copied.
  virtual void send(const JointPath& path) = 0;
};

}  // namespace lapservo
