#include "transports/ros2/wire.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace lapservo::internal {
namespace {

// The written fields point into the message: dds_write() copies, and takes nothing away.
char* pointer(const std::string& text) {
  return const_cast<char*>(text.c_str());
}
std::vector<char*> pointers(const std::vector<std::string>& texts) {
  std::vector<char*> all;
  for (const std::string& text : texts) all.push_back(pointer(text));
  return all;
}
template <typename Sequence, typename T>
void point(Sequence& sequence, const std::vector<T>& values) {
  sequence._length = sequence._maximum = static_cast<std::uint32_t>(values.size());
  sequence._buffer = const_cast<T*>(values.data());
  sequence._release = false;
}

// A Time or a Duration.
template <typename Time = builtin_interfaces_msg_dds__Time_>
Time time_of(double stamp_s) {
  Time time{};
  if (!(stamp_s >= 0 && stamp_s <= std::numeric_limits<std::int32_t>::max())) return time;
  const double whole = std::floor(stamp_s);
  time.sec_ = static_cast<std::int32_t>(whole);
  time.nanosec_ = static_cast<std::uint32_t>(std::min(std::round((stamp_s - whole) * 1e9), 999999999.0));
  return time;
}

template <typename Type>
Type with_header(double stamp_s, const char* frame = "") {
  Type wire{};
  wire.header_.stamp_ = time_of(stamp_s);
  wire.header_.frame_id_ = const_cast<char*>(frame);
  return wire;
}

geometry_msgs_msg_dds__Quaternion_ quaternion_of(const Eigen::Quaterniond& q) {
  return {q.x(), q.y(), q.z(), q.w()};
}
geometry_msgs_msg_dds__Pose_ pose_of(const Rigid3& pose) {
  const Eigen::Vector3d& at = pose.translation;
  return {{at.x(), at.y(), at.z()}, quaternion_of(pose.rotation)};
}

template <typename Time>
double seconds_of(const Time& time) {
  if (time.nanosec_ >= 1000000000u) return std::numeric_limits<double>::quiet_NaN();
  return time.sec_ + 1e-9 * time.nanosec_;
}

std::string text_of(const char* text) {
  return text ? text : "";
}

template <typename Sequence>
std::vector<std::string> texts_of(const Sequence& sequence) {
  std::vector<std::string> texts;
  for (std::uint32_t i = 0; i < sequence._length; ++i) texts.push_back(text_of(sequence._buffer[i]));
  return texts;
}

template <typename Sequence>
auto vector_of(const Sequence& sequence) {
  using T = std::decay_t<decltype(*sequence._buffer)>;
  return std::vector<T>(sequence._buffer, sequence._buffer + sequence._length);
}

}  // namespace

template <>
void Wire<JointMessage>::write(dds_entity_t writer, const JointMessage& message) {
  auto wire = with_header<Type>(message.stamp_s);
  const std::vector<char*> names = pointers(message.names);
  point(wire.name_, names);
  point(wire.position_, message.positions);
  point(wire.velocity_, message.velocities);
  dds_write(writer, &wire);
}

template <>
JointMessage Wire<JointMessage>::read(const Type& wire) {
  return {seconds_of(wire.header_.stamp_), texts_of(wire.name_), vector_of(wire.position_)};
}

template <>
void Wire<TrajectoryMessage>::write(dds_entity_t writer, const TrajectoryMessage& message) {
  auto wire = with_header<Type>(message.stamp_s);
  const std::vector<char*> names = pointers(message.names);
  std::vector<trajectory_msgs_msg_dds__JointTrajectoryPoint_> points(message.points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    point(points[i].positions_, message.points[i].positions);
    points[i].time_from_start_ = time_of<builtin_interfaces_msg_dds__Duration_>(message.points[i].time_s);
  }
  point(wire.joint_names_, names);
  point(wire.points_, points);
  dds_write(writer, &wire);
}

template <>
TrajectoryMessage Wire<TrajectoryMessage>::read(const Type& wire) {
  TrajectoryMessage message{seconds_of(wire.header_.stamp_), texts_of(wire.joint_names_), {}};
  for (std::uint32_t i = 0; i < wire.points_._length; ++i) {
    const auto& from = wire.points_._buffer[i];
    message.points.push_back({seconds_of(from.time_from_start_), vector_of(from.positions_)});
  }
  return message;
}

template <>
void Wire<OperatingStateMessage>::write(dds_entity_t writer, const OperatingStateMessage& message) {
  auto wire = with_header<Type>(message.stamp_s);
  wire.state_ = pointer(message.state);
  wire.is_homed_ = message.is_homed;
  wire.is_busy_ = message.is_busy;
  dds_write(writer, &wire);
}

template <>
OperatingStateMessage Wire<OperatingStateMessage>::read(const Type& wire) {
  return {seconds_of(wire.header_.stamp_), text_of(wire.state_), wire.is_homed_, wire.is_busy_};
}

template <>
void Wire<StringMessage>::write(dds_entity_t writer, const StringMessage& message) {
  auto wire = with_header<Type>(message.stamp_s);
  wire.string_ = pointer(message.text);
  dds_write(writer, &wire);
}

template <>
StringMessage Wire<StringMessage>::read(const Type& wire) {
  return {seconds_of(wire.header_.stamp_), text_of(wire.string_)};
}

template <>
void Wire<JoyMessage>::write(dds_entity_t writer, const JoyMessage& message) {
  auto wire = with_header<Type>(message.stamp_s);
  point(wire.buttons_, message.buttons);
  dds_write(writer, &wire);
}

template <>
JoyMessage Wire<JoyMessage>::read(const Type& wire) {
  return {seconds_of(wire.header_.stamp_), vector_of(wire.buttons_)};
}

template <>
void Wire<BoolMessage>::write(dds_entity_t writer, const BoolMessage& message) {
  const Type wire{message.value};
  dds_write(writer, &wire);
}

template <>
BoolMessage Wire<BoolMessage>::read(const Type& wire) {
  return {wire.data_};
}

template <>
void Wire<ImageMessage>::write(dds_entity_t writer, const ImageMessage& message) {
  auto wire = with_header<Type>(message.stamp_s, message.frame.c_str());
  wire.height_ = message.height;
  wire.width_ = message.width;
  wire.encoding_ = pointer(message.encoding);
  wire.is_bigendian_ = message.is_bigendian;
  wire.step_ = message.step;
  point(wire.data_, message.data);
  dds_write(writer, &wire);
}

template <>
ImageMessage Wire<ImageMessage>::read(const Type& wire) {
  ImageMessage message;
  message.stamp_s = seconds_of(wire.header_.stamp_);
  message.width = wire.width_;
  message.height = wire.height_;
  message.step = wire.step_;
  message.encoding = text_of(wire.encoding_);
  message.is_bigendian = wire.is_bigendian_ != 0;
  message.data = vector_of(wire.data_);
  return message;
}

template <>
void Wire<CompressedImageMessage>::write(dds_entity_t writer, const CompressedImageMessage& message) {
  auto wire = with_header<Type>(message.stamp_s, message.frame.c_str());
  wire.format_ = pointer(message.format);
  point(wire.data_, message.data);
  dds_write(writer, &wire);
}

template <>
CompressedImageMessage Wire<CompressedImageMessage>::read(const Type& wire) {
  return {seconds_of(wire.header_.stamp_), text_of(wire.format_), vector_of(wire.data_)};
}

template <>
void Wire<CameraInfoMessage>::write(dds_entity_t writer, const CameraInfoMessage& message) {
  auto wire = with_header<Type>(message.stamp_s, message.frame.c_str());
  static char model[] = "plumb_bob";
  wire.height_ = message.height;
  wire.width_ = message.width;
  wire.distortion_model_ = model;
  point(wire.d_, message.d);
  std::copy(message.k.begin(), message.k.end(), wire.k_);
  for (const int i : {0, 4, 8}) wire.r_[i] = 1;
  for (int i = 0; i < 9; ++i) wire.p_[i + i / 3] = message.k[i];
  dds_write(writer, &wire);
}

template <>
void Wire<PoseMessage>::write(dds_entity_t writer, const PoseMessage& message) {
  auto wire = with_header<Type>(message.stamp_s, message.frame.c_str());
  const auto& [x, y, z] = message.position_m;
  wire.pose_.pose_.position_ = {x, y, z};
  const auto& q = message.quaternion_xyzw;
  wire.pose_.pose_.orientation_ = {q[0], q[1], q[2], q[3]};
  std::copy(message.covariance.begin(), message.covariance.end(), wire.pose_.covariance_);
  dds_write(writer, &wire);
}

template <>
void Wire<PlaceMessage>::write(dds_entity_t writer, const PlaceMessage& message) {
  auto wire = with_header<Type>(message.stamp_s, message.frame.c_str());
  wire.pose_ = pose_of(message.pose);
  dds_write(writer, &wire);
}

template <>
PlaceMessage Wire<PlaceMessage>::read(const Type& wire) {
  const auto& at = wire.pose_.position_;
  const auto& turn = wire.pose_.orientation_;
  return {seconds_of(wire.header_.stamp_),
          {},
          {Eigen::Quaterniond(turn.w_, turn.x_, turn.y_, turn.z_), {at.x_, at.y_, at.z_}}};
}

template <>
void Wire<TransformsMessage>::write(dds_entity_t writer, const TransformsMessage& message) {
  std::vector<geometry_msgs_msg_dds__TransformStamped_> transforms;
  for (const TransformsMessage::Transform& one : message.transforms) {
    auto& to = transforms.emplace_back(
        with_header<geometry_msgs_msg_dds__TransformStamped_>(message.stamp_s, one.frame.c_str()));
    to.child_frame_id_ = pointer(one.child);
    const Eigen::Vector3d& at = one.frame_from_child.translation;
    to.transform_ = {{at.x(), at.y(), at.z()}, quaternion_of(one.frame_from_child.rotation)};
  }
  Type wire{};
  point(wire.transforms_, transforms);
  dds_write(writer, &wire);
}

template <>
void Wire<StaticTransformsMessage>::write(dds_entity_t writer, const StaticTransformsMessage& message) {
  Wire<TransformsMessage>::write(writer, message);
}

template <>
void Wire<CylindersMessage>::write(dds_entity_t writer, const CylindersMessage& message) {
  constexpr std::int32_t cylinder = 3;
  char* const none = const_cast<char*>("");
  std::vector<visualization_msgs_msg_dds__Marker_> markers;
  for (const CylindersMessage::Cylinder& one : message.cylinders) {
    auto& to =
        markers.emplace_back(with_header<visualization_msgs_msg_dds__Marker_>(message.stamp_s, message.frame.c_str()));
    to.ns_ = pointer(message.name);
    to.id_ = static_cast<std::int32_t>(markers.size()) - 1;
    to.type_ = cylinder;
    to.pose_ = pose_of(one.frame_from_centre);
    to.scale_ = {one.diameter_m, one.diameter_m, one.length_m};
    to.color_ = {one.rgba[0], one.rgba[1], one.rgba[2], one.rgba[3]};
    to.lifetime_ = time_of<builtin_interfaces_msg_dds__Duration_>(CylindersMessage::lifetime_s);
    to.texture_.header_.frame_id_ = to.texture_.format_ = to.texture_resource_ = none;
    to.text_ = to.mesh_resource_ = to.mesh_file_.filename_ = none;
  }
  Type wire{};
  point(wire.markers_, markers);
  dds_write(writer, &wire);
}

template <>
void Wire<DiagnosticMessage>::write(dds_entity_t writer, const DiagnosticMessage& message) {
  auto wire = with_header<Type>(message.stamp_s);
  std::vector<diagnostic_msgs_msg_dds__KeyValue_> values;
  for (const auto& [key, value] : message.values) values.push_back({pointer(key), pointer(value)});
  static char no_hardware[1] = "";
  diagnostic_msgs_msg_dds__DiagnosticStatus_ status{};
  status.level_ = static_cast<std::uint8_t>(message.level);
  status.name_ = pointer(message.name);
  status.message_ = pointer(message.message);
  status.hardware_id_ = no_hardware;
  point(status.values_, values);
  wire.status_._length = wire.status_._maximum = 1;
  wire.status_._buffer = &status;
  dds_write(writer, &wire);
}

template <>
void Wire<ObservationMessage>::write(dds_entity_t writer, const ObservationMessage& message) {
  auto wire = with_header<Type>(message.stamp_s, message.frame.c_str());
  wire.instrument_ = pointer(message.instrument);
  wire.status_ = pointer(message.status);
  wire.action_ = pointer(message.action);
  wire.reason_ = pointer(message.reason);
  const auto fill = [](const auto& values, double* to) { std::copy(values.begin(), values.end(), to); };
  fill(message.q, wire.q_);
  fill(message.q_covariance, wire.q_covariance_);
  fill(message.features, wire.features_);
  fill(message.feature_covariance, wire.feature_covariance_);
  fill(message.edges_px, wire.edges_px_);
  fill(message.error, wire.error_);
  dds_write(writer, &wire);
}

}  // namespace lapservo::internal
