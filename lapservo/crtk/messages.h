#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace lapservo::internal {

// What a CRTK site says, whatever carries it. Times are the sender's stamps in seconds; NaN where a stamp is none.

/// sensor_msgs/JointState: measured_js, setpoint_js, servo_jp. Velocities and efforts are not used.
struct JointMessage {
  double stamp_s = 0;
  std::vector<std::string> names;
  std::vector<double> positions;  ///< rad, m
};

/// crtk_msgs/OperatingState.
struct OperatingStateMessage {
  double stamp_s = 0;
  std::string state;
  bool is_homed = false, is_busy = false;
};

/// crtk_msgs/StringStamped: state_command.
struct StringMessage {
  double stamp_s = 0;
  std::string text;
};

/// sensor_msgs/Image.
struct ImageMessage {
  double stamp_s = 0;
  std::uint32_t width = 0, height = 0, step = 0;  ///< step: bytes a row
  std::string encoding;
  bool is_bigendian = false;
  std::vector<std::uint8_t> data;
};

/// sensor_msgs/CompressedImage.
struct CompressedImageMessage {
  double stamp_s = 0;
  std::string format;
  std::vector<std::uint8_t> data;
};

/// sensor_msgs/CameraInfo of a camera with plumb_bob distortion, not rectified.
struct CameraInfoMessage {
  double stamp_s = 0;
  std::uint32_t width = 0, height = 0;
  std::vector<double> d;      ///< k1 k2 p1 p2 k3
  std::array<double, 9> k{};  ///< row by row
};

}  // namespace lapservo::internal
