#pragma once

#include <dds/dds.h>

#include "lapservo/crtk/messages.h"
#include "ros2_messages.h"

namespace lapservo::internal {

/// A message as ROS 2's type on the wire: its descriptor, how it is written, and what is read of it. Reading copies.
template <typename Message>
struct Wire;

template <>
struct Wire<JointMessage> {
  using Type = sensor_msgs_msg_dds__JointState_;
  static const dds_topic_descriptor_t& descriptor() { return sensor_msgs_msg_dds__JointState__desc; }
  static void write(dds_entity_t writer, const JointMessage& message);
  static JointMessage read(const Type& wire);
};

template <>
struct Wire<TrajectoryMessage> {
  using Type = trajectory_msgs_msg_dds__JointTrajectory_;
  static const dds_topic_descriptor_t& descriptor() { return trajectory_msgs_msg_dds__JointTrajectory__desc; }
  static void write(dds_entity_t writer, const TrajectoryMessage& message);
  static TrajectoryMessage read(const Type& wire);
};

template <>
struct Wire<OperatingStateMessage> {
  using Type = crtk_msgs_msg_dds__OperatingState_;
  static const dds_topic_descriptor_t& descriptor() { return crtk_msgs_msg_dds__OperatingState__desc; }
  static void write(dds_entity_t writer, const OperatingStateMessage& message);
  static OperatingStateMessage read(const Type& wire);
};

template <>
struct Wire<StringMessage> {
  using Type = crtk_msgs_msg_dds__StringStamped_;
  static const dds_topic_descriptor_t& descriptor() { return crtk_msgs_msg_dds__StringStamped__desc; }
  static void write(dds_entity_t writer, const StringMessage& message);
  static StringMessage read(const Type& wire);
};

template <>
struct Wire<JoyMessage> {
  using Type = sensor_msgs_msg_dds__Joy_;
  static const dds_topic_descriptor_t& descriptor() { return sensor_msgs_msg_dds__Joy__desc; }
  static void write(dds_entity_t writer, const JoyMessage& message);
  static JoyMessage read(const Type& wire);
};

template <>
struct Wire<BoolMessage> {
  using Type = std_msgs_msg_dds__Bool_;
  static const dds_topic_descriptor_t& descriptor() { return std_msgs_msg_dds__Bool__desc; }
  static void write(dds_entity_t writer, const BoolMessage& message);
  static BoolMessage read(const Type& wire);
};

template <>
struct Wire<ImageMessage> {
  using Type = sensor_msgs_msg_dds__Image_;
  static const dds_topic_descriptor_t& descriptor() { return sensor_msgs_msg_dds__Image__desc; }
  static void write(dds_entity_t writer, const ImageMessage& message);
  static ImageMessage read(const Type& wire);
};

template <>
struct Wire<CompressedImageMessage> {
  using Type = sensor_msgs_msg_dds__CompressedImage_;
  static const dds_topic_descriptor_t& descriptor() { return sensor_msgs_msg_dds__CompressedImage__desc; }
  static void write(dds_entity_t writer, const CompressedImageMessage& message);
  static CompressedImageMessage read(const Type& wire);
};

template <>
struct Wire<CameraInfoMessage> {
  using Type = sensor_msgs_msg_dds__CameraInfo_;
  static const dds_topic_descriptor_t& descriptor() { return sensor_msgs_msg_dds__CameraInfo__desc; }
  static void write(dds_entity_t writer, const CameraInfoMessage& message);
};

template <>
struct Wire<PoseMessage> {
  using Type = geometry_msgs_msg_dds__PoseWithCovarianceStamped_;
  static const dds_topic_descriptor_t& descriptor() { return geometry_msgs_msg_dds__PoseWithCovarianceStamped__desc; }
  static void write(dds_entity_t writer, const PoseMessage& message);
};

template <>
struct Wire<PlaceMessage> {
  using Type = geometry_msgs_msg_dds__PoseStamped_;
  static const dds_topic_descriptor_t& descriptor() { return geometry_msgs_msg_dds__PoseStamped__desc; }
  static void write(dds_entity_t writer, const PlaceMessage& message);
  static PlaceMessage read(const Type& wire);
};

template <>
struct Wire<TransformsMessage> {
  using Type = tf2_msgs_msg_dds__TFMessage_;
  static const dds_topic_descriptor_t& descriptor() { return tf2_msgs_msg_dds__TFMessage__desc; }
  static void write(dds_entity_t writer, const TransformsMessage& message);
};
template <>
struct Wire<StaticTransformsMessage> : Wire<TransformsMessage> {};

template <>
struct Wire<CylindersMessage> {
  using Type = visualization_msgs_msg_dds__MarkerArray_;
  static const dds_topic_descriptor_t& descriptor() { return visualization_msgs_msg_dds__MarkerArray__desc; }
  static void write(dds_entity_t writer, const CylindersMessage& message);
};

template <>
struct Wire<DiagnosticMessage> {
  using Type = diagnostic_msgs_msg_dds__DiagnosticArray_;
  static const dds_topic_descriptor_t& descriptor() { return diagnostic_msgs_msg_dds__DiagnosticArray__desc; }
  static void write(dds_entity_t writer, const DiagnosticMessage& message);
};

template <>
struct Wire<ObservationMessage> {
  using Type = lapservo_msgs_msg_dds__Observation_;
  static const dds_topic_descriptor_t& descriptor() { return lapservo_msgs_msg_dds__Observation__desc; }
  static void write(dds_entity_t writer, const ObservationMessage& message);
};

}  // namespace lapservo::internal
