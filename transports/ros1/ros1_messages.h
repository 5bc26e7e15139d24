#pragma once

#include <algorithm>
#include <cmath>
#include <crtk_msgs/OperatingState.h>
#include <crtk_msgs/StringStamped.h>
#include <cstddef>
#include <cstdint>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <lapservo_msgs/Observation.h>
#include <memory>
#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/Joy.h>
#include <std_msgs/Bool.h>
#include <std_msgs/String.h>
#include <string>
#include <tf2_msgs/TFMessage.h>
#include <trajectory_msgs/JointTrajectory.h>
#include <type_traits>
#include <utility>
#include <visualization_msgs/MarkerArray.h>

#include "lapservo/crtk/messages.h"
#include "transports/typed_fields.h"

namespace lapservo::internal {

/// ROS's headers use rebind, which std::allocator lost in C++20. Text stays std::string: the messages' own allocator is
/// not one of char, since C++'s library requires that an allocator rebound to its own type is itself.
template <typename T>
struct Ros1Allocator : std::allocator<T> {
  template <typename Other>
  struct rebind {
    using other = std::conditional_t<std::is_same_v<Other, char>, std::allocator<char>, Ros1Allocator<Other>>;
  };
};

// The type of ROS 1 that carries a message.
using Ros1ByteAllocator = Ros1Allocator<std::byte>;
sensor_msgs::JointState_<Ros1ByteAllocator> ros1_type_of(const JointMessage&);
sensor_msgs::Joy_<Ros1ByteAllocator> ros1_type_of(const JoyMessage&);
std_msgs::Bool_<Ros1ByteAllocator> ros1_type_of(const BoolMessage&);
trajectory_msgs::JointTrajectory_<Ros1ByteAllocator> ros1_type_of(const TrajectoryMessage&);
crtk_msgs::OperatingState_<Ros1ByteAllocator> ros1_type_of(const OperatingStateMessage&);
crtk_msgs::StringStamped_<Ros1ByteAllocator> ros1_type_of(const StringMessage&);
std_msgs::String_<Ros1ByteAllocator> ros1_type_of(const TextMessage&);
sensor_msgs::Image_<Ros1ByteAllocator> ros1_type_of(const ImageMessage&);
sensor_msgs::CompressedImage_<Ros1ByteAllocator> ros1_type_of(const CompressedImageMessage&);
sensor_msgs::CameraInfo_<Ros1ByteAllocator> ros1_type_of(const CameraInfoMessage&);
geometry_msgs::PoseWithCovarianceStamped_<Ros1ByteAllocator> ros1_type_of(const PoseMessage&);
geometry_msgs::PoseStamped_<Ros1ByteAllocator> ros1_type_of(const PlaceMessage&);
tf2_msgs::TFMessage_<Ros1ByteAllocator> ros1_type_of(const TransformsMessage&);
visualization_msgs::MarkerArray_<Ros1ByteAllocator> ros1_type_of(const CylindersMessage&);
diagnostic_msgs::DiagnosticArray_<Ros1ByteAllocator> ros1_type_of(const DiagnosticMessage&);
lapservo_msgs::Observation_<Ros1ByteAllocator> ros1_type_of(const ObservationMessage&);
template <typename Message>
using Ros1Type = decltype(ros1_type_of(std::declval<const Message&>()));

inline ros::Time ros1_time(double stamp_s) {
  constexpr double last_s = 4294967295.0;
  if (!(stamp_s >= 0 && stamp_s <= last_s)) return {};
  const double whole = std::floor(stamp_s);
  return {static_cast<std::uint32_t>(whole),
          static_cast<std::uint32_t>(std::min(std::round((stamp_s - whole) * 1e9), 999999999.0))};
}

/// Puts fields() into such a type.
struct PutIntoRos1 {
  void operator()(auto& to, const auto& from) const {
    if constexpr (requires { to.assign(from.begin(), from.end()); }) {
      to.assign(from.begin(), from.end());
    } else if constexpr (requires { from.begin(); }) {
      std::copy(from.begin(), from.end(), to.begin());
    } else {
      to = static_cast<std::remove_reference_t<decltype(to)>>(from);
    }
  }
  void written(auto& to, const auto& from) const { (*this)(to, from); }
  void header(auto& to, double stamp_s, const std::string& frame = no_text) const {
    to.stamp = ros1_time(stamp_s);
    to.frame_id = frame;
  }
  void seconds(auto& to, double time_s) const { to.fromSec(time_s); }
  void pose(auto& to, const Rigid3& from) const { set(to, from); }
  void list(auto& to, const auto& from, auto put_one) const {
    to.resize(from.size());
    for (std::size_t i = 0; i < from.size(); ++i) put_one(to[i], from[i]);
  }
};

/// A message as ROS 1's type.
template <typename Message>
Ros1Type<Message> ros1_message(const Message& message) {
  Ros1Type<Message> wire;
  const PutIntoRos1 put;
  fields(put, wire, message);
  return wire;
}

}  // namespace lapservo::internal
