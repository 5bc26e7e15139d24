#include "apps/lapservo/transports.h"

#include "lapservo/core/error.h"
#ifdef LAPSERVO_ROS2
#include "transports/ros2/ros2_transport.h"
#endif

namespace lapservo::app {
using namespace internal;

Address address_of(const std::string& text, const std::string& option) {
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos || colon == 0 || colon + 1 == text.size())
    throw InputError(option,
                     (text.empty() ? "is missing" : "is " + text) + ", expected a transport and a name: ros2:PSM1");
  return {text.substr(0, colon), text.substr(colon + 1)};
}

std::unique_ptr<Transport> make_transport(const std::string& transport, const std::string& node_name,
                                          const std::string& option) {
  if (transport != "ros2") throw InputError(option, "is " + transport + ", expected ros2");
#ifdef LAPSERVO_ROS2
  return std::make_unique<Ros2Transport>(node_name);
#else
  throw InputError(
      option,
      "is ros2, which this build lacks: it was built without cyclonedds-dev and cyclonedds-tools (" + node_name + ")");
#endif
}

}  // namespace lapservo::app
