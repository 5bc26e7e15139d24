#include "apps/lapservo/inputs/transports.h"

#include <algorithm>
#include <set>
#include <sstream>
#include <vector>

#include "lapservo/core/environment.h"
#include "lapservo/core/error.h"
#include "lapservo/core/printable.h"
#include "transports/named_transport.h"
#ifdef LAPSERVO_ROS1
#include "transports/ros1/ros1_names.h"
#endif

namespace lapservo::app {
using namespace internal;

std::string resolved_name(const Address& address, [[maybe_unused]] const std::string& option) {
#ifdef LAPSERVO_ROS1
  if (address.transport == "ros1") return resolved_ros1_name(address.name, environment("ROS_NAMESPACE"), option);
#endif
  return address.name;
}

Address address_of(const std::string& text, const std::string& option) {
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos || colon == 0 || colon + 1 == text.size())
    throw InputError(option, (text.empty() ? "is missing" : "is " + text) +
                                 ", expected a transport and a name: ros2:PSM1 or ros1:PSM1");
  Address address{text.substr(0, colon), text.substr(colon + 1)};
  address.name = resolved_name(address, option);
  return address;
}

std::unique_ptr<Transport> make_transport(const std::string& transport, const std::string& node_name,
                                          const std::string& option) {
  if (std::ranges::count(named_transports(), transport) > 0) return named_transport(transport, node_name);
  for (const auto& [name, packages] :
       {std::pair{"ros2", "cyclonedds-dev and cyclonedds-tools"},
        {"ros1",
         "libroscpp-dev, libsensor-msgs-dev, libdiagnostic-msgs-dev, libtrajectory-msgs-dev and python3-gencpp"}})
    if (transport == name)
      throw InputError(option, "is " + transport + ", which this build lacks: it was built without " + packages);
  throw InputError(option, "is " + transport + ", expected ros2 or ros1");
}

void add_frame_names_option(Command command, std::string& frames) {
  command.add_option("--tf-frames", frames,
                     "Names in /tf of the frames of camera, RCM, marker, shaft and, where it is not NAME_tip, tip; "
                     "NAME stands for the instrument's");
}

FrameNames frame_names_of(const std::string& frames) {
  std::istringstream text(frames + ",");
  std::vector<std::string> names;
  for (std::string name; std::getline(text, name, ',');) names.push_back(name);
  if (names.size() == 4) names.push_back(FrameNames().tip);  // the tip is usually left out
  const std::set<std::string> distinct(names.begin(), names.end());
  if (names.size() != 5 || distinct.size() != 5 || distinct.contains("") ||
      frames.find_first_of(" /\t\n") != std::string::npos)
    throw InputError("--tf-frames",
                     "is " + printable(frames) +
                         ", expected four or five names: camera, RCM, marker, shaft, tip, without blanks and slashes");
  return {names[0], names[1], names[2], names[3], names[4]};
}

void add_setpoint_readers_option(Command command, int& setpoint_readers) {
  command.add_option(
      "--setpoint-readers", setpoint_readers, whole_between(1, 64),
      "Nodes that may read servo_jp: the arm's and, for example, a recorder's; while there are more, the "
      "arm is not moved");
}

void require_joint_limits(const std::string& option, const std::string& joint_limits) {
  if (joint_limits.empty())
    throw InputError(
        option,
        "needs --joint-limits, the limits of the arm's joints, for example configs/joint_limits/psm-classic.yaml");
}

}  // namespace lapservo::app
