#pragma once

#include "transports/ros1/ros1_names.h"

namespace lapservo::internal {

enum class MasterAnswer { yes, no, late };
/// Asks the master whether it is one; late: nothing came within 1.5 s.
MasterAnswer ask_ros1_master(const MasterAddress& address);

/// Asks the master whether it is one; roscpp itself would wait for it without end. Throws InputError within 2 s, naming
/// ROS_MASTER_URI and what to do, when nothing or something else answers.
void require_ros1_master(const MasterAddress& address);

}  // namespace lapservo::internal
