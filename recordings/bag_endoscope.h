#pragma once

#include <string>

#include "recordings/bag.h"

namespace lapservo::internal {

/// By how much and when the endoscope moved that an ECM holds, by the poses of .../ECM/local/measured_cp, else of
/// .../ECM/measured_cp: "the endoscope moved by N mm and N mrad between N and N s", from the first pose on. Empty where
/// it moved by no more than the noise of the poses and 0.3 mm or 2 mrad, and in a bag without such poses.
std::string endoscope_motion_text(const Bag& bag);

}  // namespace lapservo::internal
