#pragma once

#include <string>
#include <vector>

#include "lapservo/core/joint_vector.h"
#include "lapservo/robot/blocked.h"
#include "lapservo/robot/joint_path.h"
#include "lapservo/robot/operating_state.h"

namespace lapservo {

/// State of an arm (CRTK measured_js and operating_state).
struct JointState {
  /// When the joints were read, on the loop's clock: not when the reading arrived. The loop takes the joints that it
  /// gets in a tick for those of the tick; a reading that is older by some time adds this to the images' delay.
  double time_s = 0;
  JointVector q;
  OperatingState operating_state = OperatingState::disabled;
  /// False where setpoints do not move the arm: another program leads it, and the loop only reports what it would do.
  /// Its setpoints then start from the joints in each tick, and it does not hold because the arm does not follow.
  bool follows = true;
  /// The operator has said start since the last call of Robot::state(): what waits for that goes on.
  bool started = false;
  /// The first reason since the last call of Robot::state() for which the arm must not be moved, however short it was.
  /// Reasons that follow from the other fields may be left to the Supervisor.
  Blocked blocked = Blocked::none;
  /// The state in the arm's own words, where they say more than operating_state: a name that is no OperatingState
  /// ("READY", where that is disabled), a fault's cause ("FAULT (PSM1: power loss)").
  std::string other_state{};
  /// The wrist's joints behind the shaft, in the order of the rig's tool; empty where the arm does not measure them.
  std::vector<double> wrist_rad{};
};

/// The joints at one time, on the loop's clock.
struct JointReading {
  double time_s = 0;
  JointVector q;
};

/// The port to an arm. The calls come from the loop's thread, once a control tick, and must return at once: what talks
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
  /// For an arm that is read more often than a control tick comes: the readings since the last call (the newest 1000),
  /// in order of time, with that of the next state(), so that an image is compared with the joints at its exposure.
  /// Times: when the joints were read. Called just before state(). Without any, state()'s counts for the tick's time.
  virtual std::vector<JointReading> readings() { return {}; }
  /// Follow this path from now on; it replaces the one before and goes on from it without a jump. To be copied.
  virtual void send(const JointPath& path) = 0;
  /// The arm is the operator's until the next send(): once the last path has come to rest, an implementation that goes
  /// on sending setpoints stops that, so that hands or teleoperation may move the arm.
  virtual void release() {}
  /// True for an arm that exists in this program only: nobody can stand beside it. Starts count at once, and no limits
  /// have to be named.
  virtual bool is_simulated() const { return false; }
};

}  // namespace lapservo
