#include "transports/ros2/ros2_names.h"

#include <charconv>
#include <utility>

#include "lapservo/core/error.h"
#include "transports/full_name.h"

namespace lapservo::internal {

std::string dds_topic_name(const std::string& topic) {
  const std::string name = !topic.empty() && topic.front() == '/' ? topic : "/" + topic;
  if (!is_full_name(name, true))
    throw InputError("topic", "is " + topic + ", expected names of letters, digits and _ between slashes");
  return "rt" + name;
}

std::optional<std::string> ros2_topic_name(std::string_view dds_topic) {
  if (!dds_topic.starts_with("rt/")) return std::nullopt;
  return std::string(dds_topic.substr(2));
}

std::string ros2_type_name(std::string_view dds_type) {
  std::string name(dds_type);
  if (name.ends_with('_')) name.pop_back();
  for (const auto& [before, after] : {std::pair("::dds_::", "/"), std::pair("::", "/")})
    for (std::size_t at; (at = name.find(before)) != std::string::npos;)
      name.replace(at, std::string_view(before).size(), after);
  return name;
}

std::uint32_t domain_id(const std::string& text) {
  constexpr std::uint32_t max_id = 232;
  if (text.empty()) return 0;
  std::uint32_t id = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), id);
  if (error != std::errc() || end != text.data() + text.size() || id > max_id)
    throw InputError("ROS_DOMAIN_ID", "is " + text + ", expected 0 to 232");
  return id;
}

}  // namespace lapservo::internal
