#pragma once

#include <span>

#include "lapservo/tool/tool.h"

namespace lapservo::internal {

/// Throws InputError for another number of readings than the wrist has joints, and for one that is not finite.
void expect_wrist(const Tool& tool, std::span<const double> wrist_rad);

}  // namespace lapservo::internal
