#pragma once

#include "lapservo/control/trajectory.h"

namespace lapservo {

/// Section V-D's trajectory: r 795 +- 60, l 365 +- 30, d 212 +- 37 px, s 0.9 +- 0.05 rad. The periods are ours: they
/// differ, so that no feature's error can hide behind another's, and keep a dVRK's joints below a third of their rates.
inline Sinusoids paper_sinusoids() {
  Sinusoids f;
  f.offset = {0.9, 795, 365, 212};
  f.amplitude = {0.05, 60, 30, 37};
  f.period_s = {12, 10, 14, 9};
  return f;
}

}  // namespace lapservo
