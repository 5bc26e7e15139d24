#pragma once

#include <algorithm>
#include <initializer_list>
#include <string_view>

namespace lapservo::internal {

inline bool ends_like(std::string_view name, std::initializer_list<std::string_view> ends) {
  return std::any_of(ends.begin(), ends.end(), [&](std::string_view end) { return name.ends_with(end); });
}

/// Whether a file is named like one of a ROS 2 bag, of any storage.
inline bool ends_like_ros2_bag(std::string_view name) {
  return ends_like(name, {".db3", ".mcap", ".db3.zstd", ".mcap.zstd"});
}

}  // namespace lapservo::internal
