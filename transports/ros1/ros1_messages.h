#pragma once

#include <crtk_msgs/OperatingState.h>
#include <crtk_msgs/StringStamped.h>
#include <cstddef>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <lapservo_msgs/Observation.h>
#include <memory>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/Joy.h>
#include <std_msgs/Bool.h>
#include <tf2_msgs/TFMessage.h>
#include <trajectory_msgs/JointTrajectory.h>
#include <type_traits>
#include <visualization_msgs/MarkerArray.h>

#include "lapservo/crtk/messages.h"

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
namespace ros1 {
using JointState = sensor_msgs::JointState_<Ros1Allocator<std::byte>>;
using Joy = sensor_msgs::Joy_<Ros1Allocator<std::byte>>;
using Bool = std_msgs::Bool_<Ros1Allocator<std::byte>>;
using JointTrajectory = trajectory_msgs::JointTrajectory_<Ros1Allocator<std::byte>>;
using OperatingState = crtk_msgs::OperatingState_<Ros1Allocator<std::byte>>;
using StringStamped = crtk_msgs::StringStamped_<Ros1Allocator<std::byte>>;
using Image = sensor_msgs::Image_<Ros1Allocator<std::byte>>;
using CompressedImage = sensor_msgs::CompressedImage_<Ros1Allocator<std::byte>>;
using CameraInfo = sensor_msgs::CameraInfo_<Ros1Allocator<std::byte>>;
using PoseWithCovarianceStamped = geometry_msgs::PoseWithCovarianceStamped_<Ros1Allocator<std::byte>>;
using PoseStamped = geometry_msgs::PoseStamped_<Ros1Allocator<std::byte>>;
using TFMessage = tf2_msgs::TFMessage_<Ros1Allocator<std::byte>>;
using MarkerArray = visualization_msgs::MarkerArray_<Ros1Allocator<std::byte>>;
using DiagnosticArray = diagnostic_msgs::DiagnosticArray_<Ros1Allocator<std::byte>>;
using Observation = lapservo_msgs::Observation_<Ros1Allocator<std::byte>>;
}  // namespace ros1

// A message as ROS 1's type.
ros1::JointState ros1_message(const JointMessage& message);
ros1::Joy ros1_message(const JoyMessage& message);
ros1::Bool ros1_message(const BoolMessage& message);
ros1::JointTrajectory ros1_message(const TrajectoryMessage& message);
ros1::OperatingState ros1_message(const OperatingStateMessage& message);
ros1::StringStamped ros1_message(const StringMessage& message);
ros1::Image ros1_message(const ImageMessage& message);
ros1::CompressedImage ros1_message(const CompressedImageMessage& message);
ros1::CameraInfo ros1_message(const CameraInfoMessage& message);
ros1::PoseWithCovarianceStamped ros1_message(const PoseMessage& message);
ros1::PoseStamped ros1_message(const PlaceMessage& message);
ros1::TFMessage ros1_message(const TransformsMessage& message);
ros1::MarkerArray ros1_message(const CylindersMessage& message);
ros1::DiagnosticArray ros1_message(const DiagnosticMessage& message);
ros1::Observation ros1_message(const ObservationMessage& message);

}  // namespace lapservo::internal
