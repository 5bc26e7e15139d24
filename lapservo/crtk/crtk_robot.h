#pragma once

#include <atomic>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "lapservo/crtk/interlock.h"
#include "lapservo/crtk/transport.h"
#include "lapservo/robot/clock.h"
#include "lapservo/robot/robot.h"

namespace lapservo::internal {

/// A CRTK arm behind a transport: measured_js, setpoint_js, operating_state and error come in, servo_jp goes out in a
/// thread of its own, with real-time priority where the system grants it, as the interlock allows. Commands of others
/// come in by the topics that move an arm or change its efforts (servo_jp, move_jp, servo_cp, servo_cv, servo_ci, hold,
/// use_gravity_compensation ...). Joints that are not the rig's, and who reads the setpoints where that are too many,
/// are said on stderr. Destroyed, it sends nothing any more: the arm stays at its last setpoint.
class CrtkRobot : public Robot {
 public:
  /// `arm`: the arm's namespace, for example PSM1 or /dvrk/PSM1. The transport and the clock must outlive it.
  CrtkRobot(Transport& transport, const std::string& arm, const InterlockConfig& config, const Clock& clock);
  ~CrtkRobot() override;

  JointState state() override;
  std::vector<JointReading> readings() override;
  void send(const JointPath& path) override;
  void release() override;

  /// For onlookers, in any thread: what state() has to report stays noted.
  JointState latest() const;
  /// For onlookers, in any thread: what readings() has to give stays.
  std::vector<JointReading> latest_readings() const;
  InterlockCounts counts() const;
  std::optional<Eigen::Vector4d> set_point() const;
  /// "real-time priority and locked memory", or the part of them that the system did not grant for setpoints.
  std::string not_granted() const;

 private:
  void command();
  void look_at_readers();
  std::string new_complaint();  ///< empty unless it has changed

  const Clock& clock_;
  double period_s_;
  std::string arm_, said_;
  std::size_t max_readers_;
  std::set<std::string> readers_;  // the loop's thread's only
  Transport& transport_;
  mutable std::mutex mutex_;
  Interlock interlock_;
  std::string not_granted_;
  Transport::Publisher<JointMessage> servo_jp_;
  std::vector<Transport::Subscription> subscriptions_;
  std::atomic<bool> ended_ = false;
  std::thread thread_;  // last: it uses the others
};

/// "/PSM1/measured_js" of "PSM1" or "/PSM1" and "measured_js".
std::string topic_of(const std::string& arm, const std::string& name);

/// "PSM1", as the rig calls its instrument, of "/dvrk/PSM1" and of the simulated arm "SIM_PSM1".
std::string instrument_of(const std::string& arm);

}  // namespace lapservo::internal
