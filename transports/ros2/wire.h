#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <dds/dds.h>
#include <limits>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "lapservo/crtk/messages.h"
#include "ros2_messages.h"
#include "transports/typed_fields.h"

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
WireType<std_msgs_msg_dds__String_, std_msgs_msg_dds__String__desc> wire_type_of(const TextMessage&);
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

/// Puts fields() into such a type, which points into the message then.
class PutIntoRos2 {
 public:
  void operator()(char*& to, const std::string& from) const { to = const_cast<char*>(from.c_str()); }
  template <typename T, std::size_t N>
  void operator()(T (&to)[N], const std::array<T, N>& from) const {
    std::copy(from.begin(), from.end(), to);
  }
  template <typename Sequence>
  requires requires(Sequence to) { to._buffer; }
  void operator()(Sequence& to, const auto& from) {
    if constexpr (std::is_same_v<decltype(to._buffer), char**>) {
      list(to, from, *this);
    } else {
      point(to, from);
    }
  }
  template <typename Number>
  requires std::is_arithmetic_v<Number>
  void operator()(Number& to, auto from) const { to = static_cast<Number>(from); }
  void written(auto& to, const auto& from) { (*this)(to, from); }
  void header(auto& to, double stamp_s, const std::string& frame = no_text) const {
    seconds(to.stamp, stamp_s);
    (*this)(to.frame_id, frame);
  }
  void seconds(auto& to, double time_s) const {
    if (!(time_s >= 0 && time_s <= std::numeric_limits<std::int32_t>::max())) return;
    const double whole_s = std::floor(time_s);
    to.sec = static_cast<std::int32_t>(whole_s);
    to.nanosec = static_cast<std::uint32_t>(std::min(std::round((time_s - whole_s) * 1e9), 999999999.0));
  }
  void pose(auto& to, const Rigid3& from) const { set(to, from); }
  void list(auto& to, const auto& from, auto&& put_one) {
    const auto kept = std::make_shared<std::vector<std::decay_t<decltype(*to._buffer)>>>(from.size());
    for (std::size_t i = 0; i < from.size(); ++i) put_one((*kept)[i], from[i]);
    point(to, *kept);
    kept_.push_back(kept);
  }

 private:
  // dds_write() copies, and takes nothing away.
  template <typename T>
  static void point(auto& to, const std::vector<T>& from) {
    to._length = to._maximum = static_cast<std::uint32_t>(from.size());
    to._buffer = const_cast<T*>(from.data());
    to._release = false;
  }

  std::vector<std::shared_ptr<void>> kept_;  // what sequences point to, but for the message's own numbers
};

/// Takes fields() from such a type. A stamp that is none is NaN.
struct TakeFromRos2 {
  void operator()(const char* from, std::string& to) const { to = from ? from : ""; }
  template <typename T>
  void operator()(const auto& from, std::vector<T>& to) const {
    if constexpr (std::is_same_v<T, std::string>) {
      list(from, to, *this);
    } else {
      to.assign(from._buffer, from._buffer + from._length);
    }
  }
  template <typename Number>
  requires std::is_arithmetic_v<Number>
  void operator()(const auto& from, Number& to) const { to = static_cast<Number>(from); }
  void written(const auto&, const auto&) const {}
  void header(const auto& from, double& stamp_s) const { seconds(from.stamp, stamp_s); }
  void header(const auto& from, double& stamp_s, std::string& frame) const {
    seconds(from.stamp, stamp_s);
    (*this)(from.frame_id, frame);
  }
  void seconds(const auto& from, double& to_s) const {
    to_s = from.nanosec < 1000000000u ? from.sec + 1e-9 * from.nanosec : std::numeric_limits<double>::quiet_NaN();
  }
  void pose(const auto& from, Rigid3& to) const {
    const auto& [at, turn] = from;
    to = {Eigen::Quaterniond(turn.w, turn.x, turn.y, turn.z), {at.x, at.y, at.z}};
  }
  void list(const auto& from, auto& to, const auto& take_one) const {
    to.resize(from._length);
    for (std::uint32_t i = 0; i < from._length; ++i) take_one(from._buffer[i], to[i]);
  }
};

/// A message as ROS 2's type on the wire: how it is written, and what is read of it. Reading copies.
template <typename Message>
struct Wire : decltype(wire_type_of(std::declval<const Message&>())) {
  static void write(dds_entity_t writer, const Message& message) {
    typename Wire::Type wire{};
    PutIntoRos2 put;
    fields(put, wire, message);
    dds_write(writer, &wire);
  }
  static Message read(const typename Wire::Type& wire) {
    Message message;
    const TakeFromRos2 take;
    fields(take, wire, message);
    return message;
  }
};

}  // namespace lapservo::internal
