#pragma once

#include <array>
#include <optional>

#include "lapservo/vision/camera/camera_departure.h"
#include "lapservo/vision/edges/edge_blur.h"
#include "lapservo/vision/memory/look_schedule.h"
#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

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

 private:
  PoseVector expected_step(double at_s) const;
};

/// After a frame in which it was found.
InstrumentMemory remembered(const std::optional<InstrumentMemory>& before, const FineFit& fit, bool among_others,
                            double time_s);

}  // namespace lapservo::internal
