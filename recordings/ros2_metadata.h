#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace lapservo::internal {

struct Ros2BagFiles {
  std::vector<std::filesystem::path> files;
  std::string remark;         ///< which others lie there, or that metadata.yaml is missing
  bool is_unordered = false;  ///< their times decide the order
};

/// The files of a ROS 2 bag's folder: those of its metadata.yaml in its order, or all where there is none, as where a
/// recorder was killed. Throws InputError for what is compressed, of other storages than sqlite3 and mcap, listed twice
/// or not there.
Ros2BagFiles files_of_ros2_bag(const std::filesystem::path& folder);

}  // namespace lapservo::internal
