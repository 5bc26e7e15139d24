#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "lapservo/crtk/transport.h"

namespace lapservo::internal {

/// The topics of a CRTK arm from the arm's side: measured_js, setpoint_js and operating_state out, servo_jp and
/// state_command in. Whoever owns it moves the arm.
class CrtkArm {
 public:
  /// `arm`: the namespace, for example PSM1; `names`: of all its joints. The transport must outlive it.
  CrtkArm(Transport& transport, const std::string& arm, std::vector<std::string> names);

  /// Positions of all joints, rad and m, as a message of now. Throws InputError for another number of them.
  JointMessage joints(std::vector<double> positions) const;
  void say_joints(const JointMessage& measured, const JointMessage& setpoint);
  /// Publishes a state that has changed, and every 0.5 s the same one. The stamp is set here.
  void say_state(OperatingStateMessage state);

  /// The newest setpoint of servo_jp since the last call, of all joints, finite. None that came before the arm was
  /// ENABLED, homed and not busy by say_state(), or longer ago than the loop waits for it (lost_s).
  std::optional<std::vector<double>> new_setpoint();
  /// Words of state_command since the last call: enable, disable, pause, resume, home, unhome.
  std::vector<std::string> new_commands();
  /// Setpoints that were not of these joints, or not finite.
  long malformed() const;

 private:
  void take(JointMessage&& message);

  Transport& transport_;
  std::vector<std::string> names_;
  Transport::Publisher<JointMessage> measured_js_, setpoint_js_;
  Transport::Publisher<OperatingStateMessage> operating_state_;
  std::optional<OperatingStateMessage> said_;

  mutable std::mutex mutex_;  // of what the transport's threads touch
  std::optional<std::vector<double>> setpoint_;
  double arrival_s_ = 0;  // of it
  bool obeys_ = false;    // by the state that was said last
  std::vector<std::string> commands_;
  long malformed_ = 0;
  std::vector<Transport::Subscription> subscriptions_;  // last: they use the others
};

}  // namespace lapservo::internal
