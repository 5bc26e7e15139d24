#pragma once

#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <Eigen/Core>

#include "lapservo/core/bounded_queue.h"
#include "lapservo/crtk/crtk_arm.h"
#include "lapservo/crtk/transport.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/operating_state.h"
#include "lapservo/sim/simulator.h"

namespace lapservo::internal {

/// A dVRK PSM's joints as a rig names them; what the shipped rigs have.
Joints default_joints();

struct SimRobotConfig {
  std::string arm = "PSM1";           ///< namespace of the CRTK topics
  std::string camera = "/endoscope";  ///< namespace of image_raw and camera_info
  double joint_rate_hz = 250;         ///< of measured_js and setpoint_js
  /// For tests of who steers it: changes what it says.
  std::function<void(JointMessage&)> alter_measured{};
  std::function<void(ImageMessage&)> alter_image{};
};

/// Setpoints that arrived over servo_jp while the arm was enabled.
struct ServoStatistics {
  long count = 0;
  Eigen::Vector4d max_step = Eigen::Vector4d::Zero();  ///< of q, from the previous setpoint: rad, m
  long wrist_moved = 0;                                ///< those in which the wrist was not where it is
  long malformed = 0;
};

/// The simulator behind the topics of a CRTK PSM and its camera: measured_js, setpoint_js, operating_state out,
/// servo_jp and state_command (enable, disable, pause, resume, home, unhome) in; image_raw, image_raw/compressed where
/// somebody reads it, camera_info out. Its wrist has the joints of the rig's tool, or two by dVRK's names where the
/// tool has none. Starts ENABLED and homed.
class SimRobot {
 public:
  /// The rig's first instrument; its `joints`, or default_joints(). The arguments must outlive it.
  SimRobot(Transport& transport, const Rig& rig, Simulator& simulator, const SimRobotConfig& config);
  ~SimRobot();

  /// Lets the simulator's time pass and says what is due.
  void advance(double time_s);

  void set_state(OperatingState state);
  OperatingState operating_state() const;
  ServoStatistics statistics() const;

 private:
  void obey(const std::string& command);
  void obey(const std::vector<double>& positions);
  void say_joints();
  void say_state();
  void say_images();
  void compress();
  JointMessage message_of(const Eigen::Vector4d& q) const;

  Transport& transport_;
  Rig rig_;
  Simulator& simulator_;
  SimRobotConfig config_;
  Joints joints_;
  Tool tool_;
  CrtkArm arm_;
  std::vector<double> wrist_rad_;
  Eigen::Vector4d setpoint_, last_wanted_;
  double next_joints_s_ = 0, stamp_at_0_s_ = 0;

  mutable std::mutex mutex_;  // of what other threads read and set
  ServoStatistics statistics_;
  OperatingState state_ = OperatingState::enabled;
  bool homed_ = true;

  Transport::Publisher<ImageMessage> image_;
  Transport::Publisher<CompressedImageMessage> compressed_;
  Transport::Publisher<CameraInfoMessage> camera_info_;
  BoundedQueue<ImageMessage> to_compress_{1};
  std::thread compressor_;  // last: it uses the others
};

}  // namespace lapservo::internal
