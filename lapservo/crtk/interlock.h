#pragma once

#include <array>
#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/crtk/messages.h"
#include "lapservo/crtk/stamp_clock.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/reading_buffer.h"
#include "lapservo/robot/robot.h"

namespace lapservo::internal {

/// Why an arm is not moved.
enum class Blocked {
  none,
  no_joint_states,    ///< none has come yet
  old_joint_states,   ///< none with a new stamp for too long
  non_finite_joints,  ///< the latest holds a NaN or an infinity
  no_setpoint,        ///< where the arm wants to be is not known, or not any more
  no_operating_state,
  not_enabled,
  not_homed,
  busy,
  far_from_setpoint,  ///< the arm is not where its own set-point is
  held,               ///< a person wants it to stand still
  foreign_command,    ///< somebody else moves the arm; stays until the end
  stopped,            ///< stays until the end
};
/// The enumerator's name.
std::string_view to_string(Blocked blocked);

struct InterlockConfig {
  Joints joints;
  JointLimits limits;           ///< of q: positions and rates that no set-point exceeds
  double period_s = 1.0 / 500;  ///< between set-points
  double max_age_s = 0.07;      ///< of joint states and set-points
  bool motion_enabled = false;  ///< else it observes only: no set-point leaves, whatever is asked for
  /// Farther than this from its set-point an arm is not started: theta, phi [rad], rho [m], psi [rad].
  Eigen::Vector4d max_distance{0.05, 0.05, 0.005, 0.2};
};

/// What was dropped or withheld so far.
struct InterlockCounts {
  long joint_states = 0, set_points = 0;  ///< taken in; sent
  long malformed = 0;                     ///< wrong length, missing names, absurd sizes
  long repeated = 0, late = 0, jumped = 0, unstamped = 0;
  long withheld = 0;  ///< set-points that would have been sent, but for motion_enabled
};

/// Decides whether and where a CRTK arm is moved. It goes by what it is told and by the times that it is given: no
/// clock, no thread, no transport. An arm moves only while its joint states come, finite and freshly stamped, and it is
/// ENABLED, homed and not busy. Motion starts at the arm's own set-point, which a path's start is moved to; each
/// set-point differs from the one before by a period's rate limit at most and lies within the limits (or nearer to them
/// than before). Joints beyond the four stay at their set-point of the start. When anything is amiss the path is
/// forgotten, nothing is sent, and state() tells of an arm that is not enabled at least once, so that the loop starts
/// anew from where the arm is.
class Interlock {
 public:
  explicit Interlock(const InterlockConfig& config);

  // What came, with its time of arrival on the loop's clock.
  void on_measured(const JointMessage& message, double arrival_s);
  void on_setpoint(const JointMessage& message, double arrival_s);
  void on_operating_state(const OperatingStateMessage& message);
  /// Somebody else sends set-points to this arm.
  void on_foreign_command();

  /// The loop's wishes: Robot::send, and the end.
  void follow(const JointPath& path);
  void stop();
  /// A person's wish: while it holds, new paths are not followed, so that the last one brakes to rest; false is a
  /// start.
  void hold(bool on);
  /// Robot::release: until follow() others may command the arm.
  void release() { released_ = true; }

  /// Robot::state. An arm that must not be moved now is not enabled, whatever it says itself.
  JointState state(double now_s);
  /// Robot::readings.
  std::vector<JointReading> take_readings() { return readings_.take(); }
  /// To be called every period: the set-point of all the arm's joints to be sent now, if any.
  std::optional<std::vector<double>> tick(double now_s);

  Blocked blocked(double now_s) const;
  /// What the arm said of itself last; empty before it did.
  const std::string& operating_state() const { return operating_state_.state; }
  /// Names of the arm's joints, as in its set-points.
  const std::vector<std::string>& names() const { return names_; }
  /// The set-point of theta, phi, rho, psi that was sent last, or withheld; nullopt while none is wanted.
  std::optional<Eigen::Vector4d> set_point() const { return moving_ ? std::optional(last_) : std::nullopt; }
  const InterlockCounts& counts() const { return counts_; }

 private:
  struct Reading {
    double time_s = 0, arrival_s = 0;
    std::vector<double> positions;
    Eigen::Vector4d q = Eigen::Vector4d::Zero();
  };
  struct Sent {
    double time_s = 0;
    Eigen::Vector4d q = Eigen::Vector4d::Zero();
  };

  using Places = std::array<std::size_t, 4>;
  std::optional<Places> places_in(const JointMessage& message);
  std::optional<double> stamped(StampClock& clock, const JointMessage& message, double arrival_s);
  Eigen::Vector4d q_of(const JointMessage& message, const Places& places) const;
  void watch(double now_s);
  void forget_path();
  void start(double now_s);
  bool is_ours(const Reading& setpoint) const;
  Eigen::Vector4d within_limits(const Eigen::Vector4d& wanted) const;
  std::vector<double> all_joints() const;

  InterlockConfig config_;
  InterlockCounts counts_;
  StampClock measured_clock_, setpoint_clock_;
  std::optional<Reading> measured_, setpoint_;
  ReadingBuffer readings_;
  bool finite_ = true;
  OperatingStateMessage operating_state_;
  bool operating_state_known_ = false, held_ = false, foreign_ = false, stopped_ = false;
  bool released_ = false, started_ = false;
  std::vector<std::string> names_;
  Places places_{};

  std::optional<JointPath> path_;
  bool must_start_anew_ = true, told_ = false;  // the loop was told that the arm is not enabled
  bool moving_ = false;
  double blocked_s_ = 0;  // when something was amiss last
  Eigen::Vector4d shift_ = Eigen::Vector4d::Zero(), last_ = Eigen::Vector4d::Zero();
  std::vector<double> others_;  // all joints' set-points at the start
  std::deque<Sent> sent_;
};

}  // namespace lapservo::internal
