#pragma once

#include <algorithm>
#include <fstream>
#include <initializer_list>
#include <string>
#include <string_view>

namespace lapservo::internal {

inline bool ends_like(std::string_view name, std::initializer_list<std::string_view> ends) {
  return std::any_of(ends.begin(), ends.end(), [&](std::string_view end) { return name.ends_with(end); });
}

/// Whether that is what a file begins with.
inline bool begins_like(const std::string& path, std::string_view text) {
  std::string begin(text.size(), '\0');
  std::ifstream(path, std::ios::binary).read(begin.data(), static_cast<std::streamsize>(begin.size()));
  return begin == text;
}

inline bool is_mcap(const std::string& path) {
  return begins_like(path, "\x89MCAP") || ends_like(path, {".mcap"});
}

/// Whether a file is named like a ROS 1 bag, or one that is not finished.
inline bool ends_like_ros1_bag(std::string_view name) {
  return ends_like(name, {".bag", ".bag.active"});
}

/// Whether a file is named like one of a ROS 2 bag, of any storage.
inline bool ends_like_ros2_bag(std::string_view name) {
  return ends_like(name, {".db3", ".mcap", ".db3.zstd", ".mcap.zstd"});
}

}  // namespace lapservo::internal
