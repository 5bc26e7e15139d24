#pragma once

#include <algorithm>
#include <array>
#include <optional>

#include "lapservo/vision/camera/camera_departure.h"
#include "lapservo/vision/camera/picture_processing.h"
#include "lapservo/vision/edges/edge_blur.h"
#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// In which of a followed marker's frames to look at what the camera did to the image (picture_processing.h). A camera
/// that processes its images is looked at in each frame, since what to take off depends on the frame. One that does not
/// is looked at now and then, and where the blur changes (Expected). A full look that stays without an answer costs
/// several times a tracked frame, and the next frame rarely differs: it is repeated after 1, 2, 4, ... frames.
class LookSchedule {
 public:
  bool is_due() const { return frames_left_ == 0; }

  /// `fully`: the look took more than a first guess.
  void looked(Processing answer, bool fully) {
    const bool in_vain = answer == Processing::unknown && fully;
    frames_left_ = answer == Processing::none ? after_none : in_vain ? pause_ : 0;
    if (in_vain) pause_ = std::min(2 * pause_, longest_pause);
    if (answer != Processing::unknown) pause_ = 1;
  }
  void passed() { frames_left_ = std::max(0, frames_left_ - 1); }

 private:
  static constexpr int after_none = 15, longest_pause = 64;
  int frames_left_ = 0, pause_ = 1;
};

/// The memory of an instrument that was found in the frame before. Times are FrameClock's.
struct InstrumentMemory {
  double time_s;
  PoseUnknowns last;
  PoseVector step;    ///< of the unknowns, from the frame before
  double step_s = 0;  ///< which took so long; 0 where none was found before
  EdgeBlur blur;
  LookSchedule looks;
  std::array<double, 4> bias_px{};
  CameraDeparture departure;
  bool among_others = false;  ///< Found::among_others

  Expected expected(double at_s) const;
  /// Where it is when it moves on as it did, for some steps at most.
  PoseUnknowns expected_pose(double at_s) const;
};

/// After a frame in which it was found.
InstrumentMemory remembered(const std::optional<InstrumentMemory>& before, const FineFit& fit, bool among_others,
                            double time_s);

}  // namespace lapservo::internal
