#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/crtk/first_sender.h"
#include "lapservo/crtk/messages.h"
#include "lapservo/crtk/stamp_clock.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/blocked.h"
#include "lapservo/robot/reading_buffer.h"
#include "lapservo/robot/robot.h"

namespace lapservo::internal {

/// So long after its last setpoint an arm that is not there is given up as displaced.
inline constexpr double lost_s = 0.7;

struct InterlockConfig {
  Joints joints;
  JointLimits limits;           ///< of q: positions and rates that no setpoint exceeds
  double period_s = 1.0 / 500;  ///< between setpoints
  double max_age_s = 0.07;      ///< of joint states and setpoints
  std::size_t max_readers = 1;  ///< nodes that may read the setpoints: the arm's and, for example, a recorder's
  bool motion_enabled = false;  ///< else it observes only: no setpoint leaves
  /// Farther than this from its setpoint an arm is not started: theta, phi [rad], rho [m], psi [rad].
  Eigen::Vector4d max_distance{0.05, 0.05, 0.005, 0.2};
  /// Names of the joints of the rig's tool, by those of dVRK 2.3 and later or before.
  std::vector<std::string> wrist{};
};

/// For the arm of an instrument that has `joints`.
InterlockConfig interlock_of(const Instrument& instrument, const JointLimits& limits_of_q, bool motion_enabled,
                             std::size_t max_readers);

/// Counts of dropped and withheld messages.
struct InterlockCounts {
  long joint_states = 0, set_points = 0;  ///< taken in; sent
  long malformed = 0;                     ///< wrong length, missing names, absurd sizes
  long repeated = 0, late = 0, jumped = 0, unstamped = 0;
  long withheld = 0;  ///< setpoints that would have been sent, but for motion_enabled
  long pauses = 0;    ///< times that the arm was silent for longer than max_age_s while it moved
  double longest_pause_s = 0;
};

/// Turns a path into the setpoints of a CRTK arm, and reports when the arm is not ready for them. It uses only messages
/// and times that it receives: no clock, no thread, no transport. An arm is ready while its joint states arrive, finite
/// and freshly stamped, it is ENABLED, homed and not busy, no other program commands it, it does not move by itself,
/// and its setpoints have as many readers as are allowed.
///
/// Motion starts at the arm's own setpoint, to which a path's start is moved. Setpoints keep to the limits of position
/// (or come nearer to them), rate and acceleration, from one period to the next, whatever the path does and however
/// late a period is. Joints beyond the four stay at their setpoint of the start, but the wrist of the tool belongs to
/// somebody else: it may move, and its setpoints pass through. As soon as the arm is not ready the path is dropped: an
/// arm that does not obey gets nothing more, one that still listens is braked to rest first. state() reports the
/// reason, however short it was, and no new path is followed before. A path that no newer one replaces for 0.5 s counts
/// as released: its loop has ended or stands still.
///
/// A topic belongs to its first sender: messages of another one are not used before the arm has fallen silent. Then it
/// is another arm, of which nothing is known yet.
class Interlock {
 public:
  explicit Interlock(const InterlockConfig& config);

  // Received messages, with their time of arrival on the loop's clock.
  void on_measured(const JointMessage& message, double arrival_s);
  void on_setpoint(const JointMessage& message, double arrival_s);
  void on_operating_state(const OperatingStateMessage& message, double arrival_s);
  /// Changes JointState::other_state alone, and that of a FAULT which comes within a second, or is there.
  void on_error(const TextMessage& message, double arrival_s);
  /// So many nodes read the setpoints.
  void on_readers(std::size_t count) { readers_ = count; }
  /// The computer was suspended: the arm may be anywhere.
  void on_suspended(double now_s) { give_up(Blocked::loop_late, now_s); }
  /// Another program sends setpoints to this arm.
  void on_foreign_command(double arrival_s);

  /// Robot::send.
  void follow(const JointPath& path);
  /// Robot::release.
  void release() { released_ = true; }
  /// Robot::state.
  JointState state(double now_s);
  /// As all is now, for onlookers: what state() has to report stays noted.
  JointState latest(double now_s) const;
  /// Robot::readings.
  std::vector<JointReading> take_readings() { return readings_.take(); }
  /// The same for onlookers: they stay for take_readings().
  std::vector<JointReading> latest_readings() const { return readings_.all(); }
  /// Call it every period: the setpoint of all the arm's joints to send now, if any.
  std::optional<std::vector<double>> tick(double now_s);

  /// Joint velocities to the positions that tick() returned last: from those before, a period earlier; zero at rest.
  std::vector<double> velocities() const;
  /// Why the joints of the last measured_js, or else of the last setpoint_js, are not the rig's; empty when they are.
  std::string complaint() const;
  /// Names of the arm's joints, as in its setpoints.
  const std::vector<std::string>& names() const { return names_; }
  /// The setpoint of theta, phi, rho, psi that was sent last, or withheld; nullopt while none is wanted.
  std::optional<Eigen::Vector4d> set_point() const {
    return phase_ != Phase::idle ? std::optional(last_) : std::nullopt;
  }
  const InterlockCounts& counts() const { return counts_; }

 private:
  struct Reading {
    double time_s = 0, arrival_s = 0;
    std::vector<double> positions, wrist_rad{};
    Eigen::Vector4d q = Eigen::Vector4d::Zero();
  };
  struct Sent {
    double time_s = 0;
    Eigen::Vector4d q = Eigen::Vector4d::Zero();
  };

  using Places = std::array<std::size_t, 4>;
  bool is_of(FirstSender& sender, std::uint64_t source, double arrival_s);
  std::optional<Places> places_in(const JointMessage& message, const char* topic);
  std::optional<double> stamped(StampClock& clock, const JointMessage& message, double arrival_s);
  Eigen::Vector4d q_of(const JointMessage& message, const Places& places) const;
  Blocked blocked(double now_s) const;
  std::string other_state() const;
  void watch(double now_s);
  void stop(Blocked why);
  void give_up(Blocked why, double now_s);
  void begin_anew(double arrival_s);
  void watch_rest(double now_s);
  bool is_lost_on_its_way(double now_s);
  void start(double now_s);
  struct Interval {
    double begin_s = 0, end_s = 0;
  };
  /// Within the last second; nullopt for one that is farther from that path than `near` times same_q.
  std::optional<Interval> when_sent(const Reading& setpoint, double near) const;
  bool is_ours(const Reading& setpoint) const;
  bool goes_back(const Reading& setpoint);
  bool is_wrist(std::size_t place) const;
  void pass_wrist_through();
  Eigen::Vector4d within_limits(const Eigen::Vector4d& wanted) const;
  double next_velocity(Eigen::Index joint, double away, double path_velocity) const;
  bool approach(const MotionState& wanted);
  std::optional<std::vector<double>> send(double now_s);
  std::vector<double> with_the_four(std::vector<double> joints, const Eigen::Vector4d& four) const;

  InterlockConfig config_;
  InterlockCounts counts_;
  StampClock measured_clock_, setpoint_clock_;
  FirstSender measured_sender_, setpoint_sender_, state_sender_;
  std::map<std::string, std::string> complaints_;  // by topic
  std::optional<Reading> measured_, setpoint_;
  ReadingBuffer readings_;
  bool finite_ = true;
  std::optional<OperatingStateMessage> operating_state_;
  std::optional<double> fault_s_;  // since when it is FAULT; nullopt where it was when it was heard first
  TextMessage error_;              // the last one, printable
  double error_s_ = 0;
  std::optional<std::size_t> readers_;  // of the setpoints
  std::optional<double> foreign_s_;     // when somebody else commanded the arm last
  Blocked untold_ = Blocked::none;      // what was amiss first since state(); other things count more than silence
  std::vector<std::string> names_;
  Places places_{};

  enum class Phase { idle, following, braking };
  Phase phase_ = Phase::idle;
  std::optional<JointPath> path_;
  bool released_ = false;
  std::optional<double> followed_s_;  // the first tick with this path
  bool continues_ = false;            ///< from what was sent last: it was silent only
  std::optional<double> ticked_s_;
  double blocked_s_ = 0;                  // when something was amiss last
  std::optional<double> silent_since_s_;  // of an arm that moved
  Eigen::Vector4d shift_ = Eigen::Vector4d::Zero(), last_ = Eigen::Vector4d::Zero(),
                  velocity_ = Eigen::Vector4d::Zero();
  std::vector<double> others_;  // all joints' setpoints at the start, of the wrist's as they pass through
  std::deque<Sent> sent_;       // of the last second
  double passed_s_ = 0;         // the arm has reported all setpoints that were sent before
  std::optional<double> wrist_moved_s_;
  /// Where an arm was that we do not move, from when on, and when it left such a place last.
  struct Rest {
    double since_s = 0;
    Eigen::Vector4d measured = Eigen::Vector4d::Zero(), setpoint = Eigen::Vector4d::Zero();
  };
  std::optional<Rest> rest_;
  std::optional<double> moved_s_;
};

}  // namespace lapservo::internal
