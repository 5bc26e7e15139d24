#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/recording/joint_recording.h"
#include "lapservo/calibration/registration/timed_pose.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// One way in which a recording's readings, or its poses, are not those of the arm that the images show.
struct JointFault {
  /// Describes readings that have it with this size, and the remedy.
  std::function<std::string(double size)> text;
  /// Mends readings that have it with this size. Empty for an incision that gives, and for the focal length by which
  /// the poses were found: TimedPose says what that does to them.
  std::function<void(JointRecording&, double size)> mend;
  double step = 0;                   ///< for derivatives by the size; 0: it is there or not, and has no size
  double least = 0;                  ///< smaller ones are not worth a word
  std::vector<double> starts = {0};  ///< from where a fit of its size may have to begin
  double prior = 0;                  ///< Unknown::prior of its size
  bool is_linear = false;            ///< the readings are in it: the first of the starts that gives a fit suffices
  std::optional<std::size_t> gives_with{};  ///< a joint, with whose reading the RCM moves: by the size times it,
  int along = 0;                            ///< on this axis of the unrolled frame in the middle of the motion
};

/// Another focal length of the camera than that by which the poses were found.
JointFault focal_fault();

/// The poses as a focal length that is longer by this part has them, with their ByFocal: depths grow by it, the image
/// stays.
std::vector<TimedPose> with_focal(std::vector<TimedPose> poses, double longer);

/// An images' clock that runs (1 + size) times as fast as the joints', whose stamps it mends about the first one.
JointFault clock_fault(const std::vector<TimedPose>& poses);

/// Scales, couplings and times of the joints, the incision, the clock, frames that are lost, the focal length: faults
/// with a size, of which 0 is none. `delay_s`: by how much the frames' stamps are later than the joints' clock.
std::vector<JointFault> sized_joint_faults(const Joints& joints, const std::vector<TimedPose>& poses, double delay_s);

/// Columns that are exchanged, angles that wrap, readings that are held.
std::vector<JointFault> other_joint_faults(const Joints& joints);

}  // namespace lapservo::internal
