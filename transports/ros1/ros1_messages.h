#pragma once

#include <crtk_msgs/OperatingState.h>
#include <crtk_msgs/StringStamped.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <lapservo_msgs/Observation.h>
#include <memory>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/JointState.h>
#include <trajectory_msgs/JointTrajectory.h>
#include <type_traits>

#include "lapservo/crtk/messages.h"

namespace lapservo::internal {

/// ROS's headers ask allocators for what C++20 took away from std::allocator. Text stays std::string.
template <typename T>
struct Ros1Allocator : std::allocator<T> {
  template <typename Other>
  struct rebind {
    using other = std::conditional_t<std::is_same_v<Other, char>, std::allocator<char>, Ros1Allocator<Other>>;
  };
};
namespace ros1 {
using JointState = sensor_msgs::JointState_<Ros1Allocator<char>>;
using JointTrajectory = trajectory_msgs::JointTrajectory_<Ros1Allocator<char>>;
using OperatingState = crtk_msgs::OperatingState_<Ros1Allocator<char>>;
using StringStamped = crtk_msgs::StringStamped_<Ros1Allocator<char>>;
using Image = sensor_msgs::Image_<Ros1Allocator<char>>;
using CompressedImage = sensor_msgs::CompressedImage_<Ros1Allocator<char>>;
using CameraInfo = sensor_msgs::CameraInfo_<Ros1Allocator<char>>;
using PoseWithCovarianceStamped = geometry_msgs::PoseWithCovarianceStamped_<Ros1Allocator<char>>;
using DiagnosticArray = diagnostic_msgs::DiagnosticArray_<Ros1Allocator<char>>;
using Observation = lapservo_msgs::Observation_<Ros1Allocator<char>>;
}  // namespace ros1

// A message as ROS 1's type.
ros1::JointState ros1_message(const JointMessage& message);
ros1::JointTrajectory ros1_message(const TrajectoryMessage& message);
ros1::OperatingState ros1_message(const OperatingStateMessage& message);
ros1::StringStamped ros1_message(const StringMessage& message);
ros1::Image ros1_message(const ImageMessage& message);
ros1::CompressedImage ros1_message(const CompressedImageMessage& message);
ros1::CameraInfo ros1_message(const CameraInfoMessage& message);
ros1::PoseWithCovarianceStamped ros1_message(const PoseMessage& message);
ros1::DiagnosticArray ros1_message(const DiagnosticMessage& message);
ros1::Observation ros1_message(const ObservationMessage& message);

}  // namespace lapservo::internal
