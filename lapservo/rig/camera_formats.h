#pragma once

#include <span>
#include <string>

namespace lapservo::internal {

/// The text of a camera file in a rig's keys (docs/rig.md), of one that another program writes: OpenCV's
/// FileStorage, a sensor_msgs/CameraInfo as `rostopic echo` and `ros2 topic echo` print it, Kalibr's camchain of one
/// camera. Keys that the format does not have stay as they are, for the reader of a rig to use or refuse. Other text
/// comes back as it is. Throws InputError naming `source`, the format and all that is missing.
std::string with_rig_keys(const std::string& text, const std::string& source);

/// Null for coefficients of plumb_bob: k1 k2 p1 p2 k3, of which k3 or all may be left out, or k4 k5 k6 and OpenCV's
/// others of 0 may follow. Else what is expected instead of them.
const char* expected_distortion(std::span<const double> coefficients);

}  // namespace lapservo::internal
