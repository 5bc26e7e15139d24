#pragma once

#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// Throws InputError naming field, value and expectation for a rig that was put together in a program and that nothing
/// can be seen with: no instrument, a camera without size or focal length, numbers that are not finite, a marker that
/// is none.
void check_rig(const Rig& rig);

}  // namespace lapservo::internal
