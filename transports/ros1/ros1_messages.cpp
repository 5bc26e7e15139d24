#include "transports/ros1/ros1_messages.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace lapservo::internal {
namespace {

ros::Time time_of(double stamp_s) {
  constexpr double last_s = 4294967295.0;
  if (!(stamp_s >= 0 && stamp_s <= last_s)) return {};
  const double whole = std::floor(stamp_s);
  return {static_cast<std::uint32_t>(whole),
          static_cast<std::uint32_t>(std::min(std::round((stamp_s - whole) * 1e9), 999999999.0))};
}

template <typename Type>
Type with_header(double stamp_s, const std::string& frame = "") {
  Type wire;
  wire.header.stamp = time_of(stamp_s);
  wire.header.frame_id = frame;
  return wire;
}

template <typename Quaternion>
void set(Quaternion& to, const Eigen::Quaterniond& q) {
  to.x = q.x(), to.y = q.y(), to.z = q.z(), to.w = q.w();
}
template <typename Vector>
void set(Vector& to, const Eigen::Vector3d& v) {
  to.x = v.x(), to.y = v.y(), to.z = v.z();
}

}  // namespace

ros1::JointState ros1_message(const JointMessage& message) {
  auto wire = with_header<ros1::JointState>(message.stamp_s);
  wire.name.assign(message.names.begin(), message.names.end());
  wire.position.assign(message.positions.begin(), message.positions.end());
  wire.velocity.assign(message.velocities.begin(), message.velocities.end());
  return wire;
}

ros1::Joy ros1_message(const JoyMessage& message) {
  auto wire = with_header<ros1::Joy>(message.stamp_s);
  wire.buttons.assign(message.buttons.begin(), message.buttons.end());
  return wire;
}

ros1::Bool ros1_message(const BoolMessage& message) {
  ros1::Bool wire;
  wire.data = message.value;
  return wire;
}

ros1::JointTrajectory ros1_message(const TrajectoryMessage& message) {
  auto wire = with_header<ros1::JointTrajectory>(message.stamp_s);
  wire.joint_names.assign(message.names.begin(), message.names.end());
  for (const auto& point : message.points) {
    auto& to = wire.points.emplace_back();
    to.positions.assign(point.positions.begin(), point.positions.end());
    to.time_from_start.fromSec(point.time_s);
  }
  return wire;
}

ros1::OperatingState ros1_message(const OperatingStateMessage& message) {
  auto wire = with_header<ros1::OperatingState>(message.stamp_s);
  wire.state = message.state;
  wire.is_homed = message.is_homed;
  wire.is_busy = message.is_busy;
  return wire;
}

ros1::StringStamped ros1_message(const StringMessage& message) {
  auto wire = with_header<ros1::StringStamped>(message.stamp_s);
  wire.string = message.text;
  return wire;
}

ros1::Image ros1_message(const ImageMessage& message) {
  auto wire = with_header<ros1::Image>(message.stamp_s, message.frame);
  wire.height = message.height;
  wire.width = message.width;
  wire.encoding = message.encoding;
  wire.is_bigendian = message.is_bigendian;
  wire.step = message.step;
  wire.data.assign(message.data.begin(), message.data.end());
  return wire;
}

ros1::CompressedImage ros1_message(const CompressedImageMessage& message) {
  auto wire = with_header<ros1::CompressedImage>(message.stamp_s, message.frame);
  wire.format = message.format;
  wire.data.assign(message.data.begin(), message.data.end());
  return wire;
}

ros1::CameraInfo ros1_message(const CameraInfoMessage& message) {
  auto wire = with_header<ros1::CameraInfo>(message.stamp_s, message.frame);
  wire.height = message.height;
  wire.width = message.width;
  wire.distortion_model = "plumb_bob";
  wire.D.assign(message.d.begin(), message.d.end());
  std::copy(message.k.begin(), message.k.end(), wire.K.begin());
  for (const std::size_t i : {0u, 4u, 8u}) wire.R[i] = 1;
  for (std::size_t i = 0; i < 9; ++i) wire.P[i + i / 3] = message.k[i];
  return wire;
}

ros1::PoseWithCovarianceStamped ros1_message(const PoseMessage& message) {
  auto wire = with_header<ros1::PoseWithCovarianceStamped>(message.stamp_s, message.frame);
  set(wire.pose.pose.position, Eigen::Vector3d(message.position_m.data()));
  set(wire.pose.pose.orientation, Eigen::Quaterniond(message.quaternion_xyzw.data()));
  std::copy(message.covariance.begin(), message.covariance.end(), wire.pose.covariance.begin());
  return wire;
}

ros1::PoseStamped ros1_message(const PlaceMessage& message) {
  auto wire = with_header<ros1::PoseStamped>(message.stamp_s, message.frame);
  set(wire.pose.position, message.pose.translation);
  set(wire.pose.orientation, message.pose.rotation);
  return wire;
}

ros1::TFMessage ros1_message(const TransformsMessage& message) {
  ros1::TFMessage wire;
  for (const TransformsMessage::Transform& one : message.transforms) {
    auto& to = wire.transforms.emplace_back();
    to.header.stamp = time_of(message.stamp_s);
    to.header.frame_id = one.frame;
    to.child_frame_id = one.child;
    set(to.transform.translation, one.frame_from_child.translation);
    set(to.transform.rotation, one.frame_from_child.rotation);
  }
  return wire;
}

ros1::MarkerArray ros1_message(const CylindersMessage& message) {
  ros1::MarkerArray wire;
  for (const CylindersMessage::Cylinder& one : message.cylinders) {
    auto& to = wire.markers.emplace_back();
    to.header.stamp = time_of(message.stamp_s);
    to.header.frame_id = message.frame;
    to.ns = message.name;
    to.id = static_cast<std::int32_t>(wire.markers.size()) - 1;
    to.type = to.CYLINDER;
    set(to.pose.position, one.frame_from_centre.translation);
    set(to.pose.orientation, one.frame_from_centre.rotation);
    set(to.scale, Eigen::Vector3d(one.diameter_m, one.diameter_m, one.length_m));
    to.color.r = one.rgba[0], to.color.g = one.rgba[1], to.color.b = one.rgba[2], to.color.a = one.rgba[3];
    to.lifetime.fromSec(CylindersMessage::lifetime_s);
  }
  return wire;
}

ros1::DiagnosticArray ros1_message(const DiagnosticMessage& message) {
  auto wire = with_header<ros1::DiagnosticArray>(message.stamp_s);
  auto& status = wire.status.emplace_back();
  status.level = static_cast<std::int8_t>(message.level);
  status.name = message.name;
  status.message = message.message;
  for (const auto& [key, value] : message.values) {
    auto& pair = status.values.emplace_back();
    pair.key = key;
    pair.value = value;
  }
  return wire;
}

ros1::Observation ros1_message(const ObservationMessage& message) {
  auto wire = with_header<ros1::Observation>(message.stamp_s, message.frame);
  wire.instrument = message.instrument;
  wire.status = message.status;
  wire.action = message.action;
  wire.reason = message.reason;
  const auto fill = [](const auto& values, auto& to) { std::copy(values.begin(), values.end(), to.begin()); };
  fill(message.q, wire.q);
  fill(message.q_covariance, wire.q_covariance);
  fill(message.features, wire.features);
  fill(message.feature_covariance, wire.feature_covariance);
  fill(message.edges_px, wire.edges_px);
  fill(message.error, wire.error);
  return wire;
}

}  // namespace lapservo::internal
