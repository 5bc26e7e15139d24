#include "transports/ros1/ros1_names.h"

#include <charconv>
#include <cstdlib>

#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {

bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}
bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

// Words of letters, digits and underscores, each behind one slash and beginning with a letter.
bool is_full_name(const std::string& name) {
  if (name.size() < 2 || name.size() > 200 || name.front() != '/' || name.back() == '/') return false;
  char before = 0;
  for (const char c : name) {
    if (!is_letter(c) && !is_digit(c) && c != '_' && c != '/') return false;
    if (before == '/' && !is_letter(c)) return false;
    before = c;
  }
  return true;
}

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

std::string ros1_namespace() {
  const char* const space = std::getenv("ROS_NAMESPACE");
  return space ? space : "";
}

std::string resolved_ros1_name(const std::string& name, const std::string& ros_namespace, const std::string& what) {
  std::string full = name;
  if (name.empty() || name.front() != '/') {
    std::string before = ros_namespace;
    while (!before.empty() && before.back() == '/') before.pop_back();
    if (!before.empty() && before.front() != '/') before.insert(0, "/");
    full = before + "/" + name;
  }
  if (!is_full_name(full))
    throw InputError(
        what,
        "is " + full + ", expected words of letters, digits and _, each beginning with a letter, between slashes");
  return full;
}

}  // namespace lapservo::internal
