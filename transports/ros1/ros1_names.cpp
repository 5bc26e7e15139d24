#include "transports/ros1/ros1_names.h"

#include <charconv>

#include "lapservo/core/error.h"
#include "transports/full_name.h"

namespace lapservo::internal {
namespace {

[[noreturn]] void refuse_uri(const std::string& text) {
  throw InputError("ROS_MASTER_URI", "is " + text + ", expected http://HOST:PORT");
}

}  // namespace

MasterAddress master_address(const std::string& text) {
  if (text.empty()) return {"localhost", 11311};
  constexpr std::string_view scheme = "http://";
  if (text.compare(0, scheme.size(), scheme) != 0) refuse_uri(text);
  std::string rest = text.substr(scheme.size());
  if (!rest.empty() && rest.back() == '/') rest.pop_back();
  const std::size_t colon = rest.find(':');
  if (colon == std::string::npos || colon == 0 || rest.find_first_of("/ ") != std::string::npos) refuse_uri(text);
  MasterAddress address{rest.substr(0, colon), 0};
  const char* const end = rest.data() + rest.size();
  const auto [at, error] = std::from_chars(rest.data() + colon + 1, end, address.port);
  if (error != std::errc() || at != end || address.port < 1 || address.port > 65535) refuse_uri(text);
  return address;
}

std::string to_string(const MasterAddress& address) {
  return "http://" + address.host + ":" + std::to_string(address.port);
}

std::string resolved_ros1_name(const std::string& name, const std::string& ros_namespace, const std::string& what) {
  std::string full = name;
  if (name.empty() || name.front() != '/') {
    std::string before = ros_namespace;
    while (!before.empty() && before.back() == '/') before.pop_back();
    if (!before.empty() && before.front() != '/') before.insert(0, "/");
    full = before + "/" + name;
  }
  if (!is_full_name(full, false))
    throw InputError(
        what,
        "is " + full + ", expected words of letters, digits and _, each beginning with a letter, between slashes");
  return full;
}

}  // namespace lapservo::internal
