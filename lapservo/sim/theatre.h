#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include <Eigen/Core>

#include "lapservo/kinematics/rcm_coordinates.h"
#include "lapservo/rig/rig.h"
#include "lapservo/sim/arm.h"
#include "lapservo/sim/endoscope.h"

namespace lapservo {

struct TheatreConfig {
  ArmConfig arm;
  EndoscopeConfig endoscope;
  RenderOptions render;
  std::uint64_t seed = 1;  ///< of tissue, noise, jitter and lost frames
};

/// An interval of simulated time, for example in which the marker is covered: from `begin_s` up to `end_s`.
struct Interval {
  double begin_s = 0, end_s = 0;
  bool contains(double time_s) const { return begin_s <= time_s && time_s < end_s; }
};

/// A frame with its truth.
struct TheatreFrame {
  EndoscopePicture picture;
  RcmCoordinates q;  ///< of the instrument in the middle of the exposure, for evaluation
};

/// A simulated operating theatre: the first instrument of a rig on an arm, before an endoscope. Simulated time starts
/// at 0 and passes only in step(). The same configuration, seed and commands give the same frames, bit for bit.
class Theatre {
 public:
  /// `rig` is how things really are; what a program believes may differ. Its first instrument needs camera_from_rcm
  /// (else InputError). The arm starts at rest with these readings.
  Theatre(const Rig& rig, const TheatreConfig& config, const RcmCoordinates& readings);

  void servo_jp(const Eigen::Vector4d& setpoint) { arm_.servo_jp(setpoint); }
  /// Lets time pass; frames are taken when they are due, also within a step. Not backwards (std::invalid_argument).
  void step(double dt_s);
  double time_s() const { return time_s_; }
  Eigen::Vector4d measured_jp() const { return arm_.measured_jp(); }
  /// Frames that have arrived by now and since the last call.
  std::vector<TheatreFrame> arrived();

  Arm& arm() { return arm_; }
  const Arm& arm() const { return arm_; }
  /// Light on the scene from now on: 1 is usual.
  void set_light(float light) { endoscope_.set_light(light); }
  /// Something lies over the whole marker then.
  void cover_marker(const Interval& when) { covered_.push_back(when); }

  /// The instrument in the camera's truth, now.
  RcmCoordinates true_q() const { return RcmCoordinates::from_vector(arm_.true_jp()); }
  ShaftPlacement placement() const;

 private:
  Rigid3 camera_from_rcm_;
  Arm arm_;
  Endoscope endoscope_;
  std::vector<Interval> covered_;
  double time_s_ = 0;
  Exposure exposing_;                     // the moments of the current frame so far
  std::map<long, RcmCoordinates> truth_;  // of frames on their way
  long taken_ = 0;
};

}  // namespace lapservo
