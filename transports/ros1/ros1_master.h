#pragma once

#include "transports/ros1/ros1_names.h"

namespace lapservo::internal {

enum class MasterAnswer { yes, no, late };
/// Queries whether the address is a master; late: no answer within 1.5 s.
MasterAnswer ask_ros1_master(const MasterAddress& address);

/// Checks that a master answers; roscpp itself would wait for it without end. Throws InputError within 2 s, naming
/// ROS_MASTER_URI and the remedy, when nothing or something else answers.
void require_ros1_master(const MasterAddress& address);

}  // namespace lapservo::internal
