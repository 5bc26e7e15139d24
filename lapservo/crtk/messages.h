#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "lapservo/geometry/rigid3.h"

namespace lapservo::internal {

/// Whether T is that message, const or not.
template <typename T, typename Message>
concept Is = std::derived_from<std::remove_const_t<T>, Message>;

// Messages of a CRTK site, independent of the transport. Times are the sender's stamps in seconds; NaN for an invalid
// stamp.

/// Whether a message may have been said long ago, as a latching publisher of ROS 1 begins every connection with its
/// last one: `again` where this program had a connection before.
enum class Latched : std::uint8_t { no, perhaps, again };

/// sensor_msgs/JointState: measured_js, setpoint_js, servo_jp. Efforts are not used.
struct JointMessage {
  double stamp_s = 0;
  std::vector<std::string> names;
  std::vector<double> positions;     ///< rad, m
  std::vector<double> velocities{};  ///< rad/s, m/s; written, not read
  std::uint64_t source = 0;          ///< whoever sent it: of what came, a number for each program
  Latched latched = Latched::no;
};

/// trajectory_msgs/JointTrajectory. Velocities, accelerations and efforts are not used.
struct TrajectoryMessage {
  struct Point {
    double time_s = 0;  ///< from the start
    std::vector<double> positions;
  };
  double stamp_s = 0;
  std::vector<std::string> names;
  std::vector<Point> points;
  std::uint64_t source = 0;  ///< as in JointMessage
  Latched latched = Latched::no;
  std::string frame{};
};

/// crtk_msgs/OperatingState.
struct OperatingStateMessage {
  double stamp_s = 0;
  std::string state;
  bool is_homed = false, is_busy = false;
  std::uint64_t source = 0;  ///< as in JointMessage
};

/// crtk_msgs/StringStamped: state_command.
struct StringMessage {
  double stamp_s = 0;
  std::string text;
  std::uint64_t source = 0;  ///< as in JointMessage
  Latched latched = Latched::no;
};

/// std_msgs/String: error, in an arm's own words.
struct TextMessage {
  std::string text;
  std::uint64_t source = 0;  ///< as in JointMessage
  Latched latched = Latched::no;
};

/// A command of motion, of which only the arrival counts.
struct CommandMessage {};

/// The content of a CRTK command of motion: joints (sensor_msgs/JointState), the same with modes
/// (crtk_msgs/JointServo), a pose (geometry_msgs/PoseStamped, up to dVRK 2.1 TransformStamped), a twist (TwistStamped),
/// a wrench (WrenchStamped), all three (crtk_msgs/CartesianState or CartesianServo), an impedance
/// (crtk_msgs/CartesianImpedance), a switch (std_msgs/Bool), or nothing (std_msgs/Empty).
enum class CommandType { joints, joint_servo, pose, twist, wrench, cartesian_state, impedance, on_or_off, nothing };

/// sensor_msgs/Joy: foot pedals. Axes are not used.
struct JoyMessage {
  double stamp_s = 0;
  std::vector<std::int32_t> buttons;  ///< 1 where pressed
};

/// std_msgs/Bool: a button.
struct BoolMessage {
  bool value = false;
};
inline BoolMessage first_button(const JoyMessage& message) {
  return {!message.buttons.empty() && message.buttons.front() == 1};
}

/// The camera's frame in what is published, where nobody names another.
inline constexpr const char* camera_frame = "endoscope";

/// sensor_msgs/Image.
struct ImageMessage {
  double stamp_s = 0;
  std::uint32_t width = 0, height = 0, step = 0;  ///< step: bytes a row
  std::string encoding;
  bool is_bigendian = false;
  std::vector<std::uint8_t> data;
  std::uint64_t source = 0;  ///< as in JointMessage
  std::string frame{};
};

/// sensor_msgs/CompressedImage.
struct CompressedImageMessage {
  double stamp_s = 0;
  std::string format;
  std::vector<std::uint8_t> data;
  std::uint64_t source = 0;  ///< as in JointMessage
  std::string frame{};
};

/// sensor_msgs/CameraInfo of a camera with plumb_bob distortion, not rectified.
struct CameraInfoMessage {
  double stamp_s = 0;
  std::uint32_t width = 0, height = 0;
  std::vector<double> d;      ///< k1 k2 p1 p2 k3
  std::array<double, 9> k{};  ///< row by row
  std::string frame{};
};

/// geometry_msgs/PoseWithCovarianceStamped: position, then the rotation's vector, in the frame's axes.
struct PoseMessage {
  double stamp_s = 0;
  std::string frame;
  std::array<double, 3> position_m{};
  std::array<double, 4> quaternion_xyzw{0, 0, 0, 1};
  std::array<double, 36> covariance{};  ///< row by row
};

/// geometry_msgs/PoseStamped: measured_cp, set_base_frame, tip_goal.
struct PlaceMessage {
  double stamp_s = 0;
  std::string frame;
  Rigid3 pose;               ///< frame_from_body
  std::uint64_t source = 0;  ///< as in JointMessage
  Latched latched = Latched::no;
};

/// tf2_msgs/TFMessage: /tf.
struct TransformsMessage {
  struct Transform {
    std::string frame, child;
    Rigid3 frame_from_child;
  };
  double stamp_s = 0;
  std::vector<Transform> transforms;
};
/// /tf_static: the last one reaches subscribers that come later.
struct StaticTransformsMessage : TransformsMessage {};

/// visualization_msgs/MarkerArray of cylinders, which viewers forget 0.5 s later.
struct CylindersMessage {
  struct Cylinder {
    Rigid3 frame_from_centre;  ///< z along the axis
    double diameter_m = 0, length_m = 0;
    std::array<float, 4> rgba{};  ///< 0 to 1
  };
  static constexpr double lifetime_s = 0.5;
  double stamp_s = 0;
  std::string frame, name;  ///< the name by which viewers keep them apart from others
  std::vector<Cylinder> cylinders;
};

/// diagnostic_msgs/DiagnosticArray of one status.
struct DiagnosticMessage {
  enum class Level : std::uint8_t { ok, warning, error };
  double stamp_s = 0;
  Level level = Level::ok;
  std::string name, message;
  std::vector<std::pair<std::string, std::string>> values;
};

/// lapservo_msgs/Observation; see its .msg.
struct ObservationMessage {
  double stamp_s = 0;
  std::string frame, instrument, status, action, reason;
  std::array<double, 4> q{}, features{}, error{};
  std::array<double, 16> q_covariance{}, feature_covariance{};
  std::array<double, 8> edges_px{};
};

}  // namespace lapservo::internal
