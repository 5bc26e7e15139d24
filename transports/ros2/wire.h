#pragma once

#include <dds/dds.h>
#include <utility>

#include "lapservo/crtk/messages.h"
#include "ros2_messages.h"

namespace lapservo::internal {

/// A type of ROS 2's wire, with its descriptor.
template <typename DdsType, const dds_topic_descriptor_t& description>
struct WireType {
  using Type = DdsType;
  static const dds_topic_descriptor_t& descriptor() { return description; }
};

// That which carries a message.
WireType<sensor_msgs_msg_dds__JointState_, sensor_msgs_msg_dds__JointState__desc> wire_type_of(const JointMessage&);
WireType<trajectory_msgs_msg_dds__JointTrajectory_, trajectory_msgs_msg_dds__JointTrajectory__desc> wire_type_of(
    const TrajectoryMessage&);
WireType<crtk_msgs_msg_dds__OperatingState_, crtk_msgs_msg_dds__OperatingState__desc> wire_type_of(
    const OperatingStateMessage&);
WireType<crtk_msgs_msg_dds__StringStamped_, crtk_msgs_msg_dds__StringStamped__desc> wire_type_of(const StringMessage&);
WireType<sensor_msgs_msg_dds__Joy_, sensor_msgs_msg_dds__Joy__desc> wire_type_of(const JoyMessage&);
WireType<std_msgs_msg_dds__Bool_, std_msgs_msg_dds__Bool__desc> wire_type_of(const BoolMessage&);
WireType<sensor_msgs_msg_dds__Image_, sensor_msgs_msg_dds__Image__desc> wire_type_of(const ImageMessage&);
WireType<sensor_msgs_msg_dds__CompressedImage_, sensor_msgs_msg_dds__CompressedImage__desc> wire_type_of(
    const CompressedImageMessage&);
WireType<sensor_msgs_msg_dds__CameraInfo_, sensor_msgs_msg_dds__CameraInfo__desc> wire_type_of(
    const CameraInfoMessage&);
WireType<geometry_msgs_msg_dds__PoseWithCovarianceStamped_, geometry_msgs_msg_dds__PoseWithCovarianceStamped__desc>
wire_type_of(const PoseMessage&);
WireType<geometry_msgs_msg_dds__PoseStamped_, geometry_msgs_msg_dds__PoseStamped__desc> wire_type_of(
    const PlaceMessage&);
WireType<tf2_msgs_msg_dds__TFMessage_, tf2_msgs_msg_dds__TFMessage__desc> wire_type_of(const TransformsMessage&);
WireType<visualization_msgs_msg_dds__MarkerArray_, visualization_msgs_msg_dds__MarkerArray__desc> wire_type_of(
    const CylindersMessage&);
WireType<diagnostic_msgs_msg_dds__DiagnosticArray_, diagnostic_msgs_msg_dds__DiagnosticArray__desc> wire_type_of(
    const DiagnosticMessage&);
WireType<lapservo_msgs_msg_dds__Observation_, lapservo_msgs_msg_dds__Observation__desc> wire_type_of(
    const ObservationMessage&);

/// A message as ROS 2's type on the wire: how it is written, and what is read of it. Reading copies.
template <typename Message>
struct Wire : decltype(wire_type_of(std::declval<const Message&>())) {
  static void write(dds_entity_t writer, const Message& message);
  static Message read(const typename Wire::Type& wire);
};

}  // namespace lapservo::internal
