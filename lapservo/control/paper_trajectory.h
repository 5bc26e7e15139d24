#pragma once

#include "lapservo/control/trajectory.h"

namespace lapservo {

/// Section V-D's trajectory: s 0.9 +- 0.05 rad, r 795 +- 60, l 365 +- 30, d 212 +- 37 px, all with omega = 0.5 and no
/// phase. The paper gives no unit of time; omega is read in rad/s (a period of 12.6 s).
inline Sinusoids paper_sinusoids() {
  Sinusoids f;
  f.offset = {0.9, 795, 365, 212};
  f.amplitude = {0.05, 60, 30, 37};
  f.omega_rad_s.setConstant(0.5);
  return f;
}

}  // namespace lapservo
