#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "lapservo/geometry/rigid3.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/clock.h"
#include "lapservo/robot/reading_buffer.h"
#include "lapservo/robot/robot.h"
#include "lapservo/sim/arm.h"
#include "lapservo/sim/endoscope.h"
#include "lapservo/stream/image_stream.h"

namespace lapservo {

struct SimulatorConfig {
  ArmConfig arm;
  EndoscopeConfig endoscope;
  RenderOptions render;
  std::vector<Blotch> blotches;  ///< of blood, on the marker
  double arm_rate_hz = 1000;     ///< at which the arm samples a path
  double wrist_swing_rad = 0;    ///< of the first joint of the tool's wrist by somebody else, there and back within 4 s
  std::uint64_t seed = 1;        ///< of tissue, noise, jitter and lost frames
};

/// An interval of simulated time, for example in which the marker is covered: from `begin_s` up to `end_s`.
struct Interval {
  double begin_s = 0, end_s = 0;
  bool contains(double time_s) const { return begin_s <= time_s && time_s < end_s; }
};

/// Evenly, or from rest to rest as a hand moves, with the least jerk.
enum class MotionProfile { even, smooth };

/// The endoscope moves: the camera goes, within `duration_s` (0: at once), by this much in its own frame as it was when
/// it began.
struct EndoscopeMotion {
  double begin_s = 0, duration_s = 0;
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero();  ///< vector: about its direction, by its length
  MotionProfile profile = MotionProfile::even;

  /// Returns itself if all its numbers make sense; else throws InputError naming the first field that doesn't.
  const EndoscopeMotion& checked() const;
};

/// A frame with its truth.
struct SimulatedFrame {
  EndoscopePicture picture;
  JointVector q;  ///< of the instrument in the middle of the exposure, for evaluation
};

/// A simulated operating room: the first instrument of a rig on an arm, before an endoscope, and the time that they
/// share. It is a robot, its camera and its clock at once, as the servo loop wants them. Simulated time starts at 0 and
/// passes only in sleep_until() and step(). The same configuration, seed and commands give the same frames, bit for
/// bit.
class Simulator : public Robot, public ImageStream, public Clock {
 public:
  /// `rig` is the true scene; a program's rig may differ. Its first instrument needs camera_from_rcm (else InputError).
  /// The arm starts at rest with these measured joints.
  Simulator(const Rig& rig, const SimulatorConfig& config, const JointVector& q_measured);
  /// With an arm of another kind; of SimulatorConfig::arm only rcm_offset_m counts.
  Simulator(const Rig& rig, const SimulatorConfig& config, std::unique_ptr<SimulatedArm> arm);

  JointState state() override;
  /// As often as the arm samples its path.
  std::vector<JointReading> readings() override { return readings_.take(); }
  void send(const JointPath& path) override;
  bool is_simulated() const override { return true; }
  std::optional<StampedImage> newest() override;
  double now_s() const override { return time_s_; }
  /// Lets time pass; the arm samples the path at SimulatorConfig::arm_rate_hz.
  void sleep_until(double time_s) override;

  /// A single setpoint instead of a path.
  void servo_jp(const Eigen::Vector4d& setpoint) { arm_->servo_jp(setpoint); }
  /// Lets time pass; frames are taken when they are due, also within a step. Not backwards (std::invalid_argument).
  void step(double dt_s);
  Eigen::Vector4d measured_jp() const { return arm_->measured_jp(); }
  /// Frames that have arrived by now and since the last call, with their truth. newest() takes from the same.
  std::vector<SimulatedFrame> arrived();

  SimulatedArm& arm() { return *arm_; }
  const SimulatedArm& arm() const { return *arm_; }
  /// Light on the scene from now on: 1 is usual.
  void set_light(float light) { light_ = light; }
  /// So many times as much then.
  void change_light(const Interval& when, float times) { light_changes_.push_back({when, times}); }
  /// Something lies over the whole marker then.
  void cover_marker(const Interval& when) { covered_.push_back(when); }

  /// Motions that overlap in time add up in the order in which they were given.
  void move_endoscope(const EndoscopeMotion& motion) { endoscope_motions_.push_back(motion.checked()); }
  /// The present place of a point that was given in the camera's frame at the beginning.
  Rigid3 camera_from_first_camera() const;

  /// Readings of the joints of the tool's wrist now; none without a wrist.
  std::vector<double> wrist_rad() const;
  /// By how much its first joint has swung.
  double wrist_swung_rad() const;
  /// The instrument in the camera's truth, now.
  JointVector true_q() const { return JointVector::from_vector(arm_->true_jp()); }
  ShaftPlacement placement() const;

 private:
  float light_now() const;

  Rigid3 camera_from_rcm_;
  std::unique_ptr<SimulatedArm> arm_;
  Endoscope endoscope_;
  double arm_period_s_;
  Tool tool_;
  double wrist_swing_rad_;
  std::optional<JointPath> path_;
  ReadingBuffer readings_;
  std::vector<Interval> covered_;
  struct LightChange {
    Interval when;
    float times = 1;
  };
  float light_ = 1;
  std::vector<LightChange> light_changes_;
  std::vector<EndoscopeMotion> endoscope_motions_;
  double time_s_ = 0;
  Exposure exposing_;                  // the moments of the current frame so far
  std::map<long, JointVector> truth_;  // of frames on their way
  long taken_ = 0;
};

}  // namespace lapservo
