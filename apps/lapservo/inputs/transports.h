#pragma once

#include <memory>
#include <string>

#include "apps/lapservo/cli/command.h"
#include "lapservo/crtk/transport.h"
#include "lapservo/loop_topics/frame_topics.h"

namespace lapservo::app {

/// "ros2" and "PSM1" of "ros2:PSM1".
struct Address {
  std::string transport, name;
};
/// A name as the transport knows it: in ROS 1 it stands in ROS_NAMESPACE unless it begins with a slash. Throws
/// InputError, naming `option`, for what is none.
std::string resolved_name(const Address& address, const std::string& option);
/// With its name resolved. Throws InputError, naming `option`, for what has no such form.
Address address_of(const std::string& text, const std::string& option);

/// Throws InputError for one that is unknown or that this build lacks.
std::unique_ptr<internal::Transport> make_transport(const std::string& transport, const std::string& node_name,
                                                    const std::string& option);

constexpr auto default_frames = "endoscope,NAME_rcm,NAME_marker,NAME_shaft";
/// --tf-frames of the commands that publish frames.
void add_frame_names_option(Command command, std::string& frames);
/// Throws InputError for what are not four or five names.
internal::FrameNames frame_names_of(const std::string& frames);

/// --setpoint-readers of the commands that move an arm.
void add_setpoint_readers_option(Command command, int& setpoint_readers);

/// Throws InputError, naming `option`, which moves an arm, when the file of the arm's limits is not given.
void require_joint_limits(const std::string& option, const std::string& joint_limits);

}  // namespace lapservo::app
