#pragma once

#include <string>

namespace lapservo::internal {

/// The text of a camera file in a rig's keys (docs/rig.md), of one that another program writes: OpenCV's
/// FileStorage, a sensor_msgs/CameraInfo as `rostopic echo` and `ros2 topic echo` print it, Kalibr's camchain of one
/// camera. Other text comes back as it is. Throws InputError naming `source`, the format and all that is missing.
std::string with_rig_keys(const std::string& text, const std::string& source);

}  // namespace lapservo::internal
