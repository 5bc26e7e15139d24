#pragma once

#include <filesystem>
#include <vector>

namespace lapservo::internal {

struct Ros2BagFiles {
  std::vector<std::filesystem::path> listed;    ///< in the order of metadata.yaml
  std::vector<std::filesystem::path> unlisted;  ///< others that lie there, by name
};

/// The files of a ROS 2 bag's folder. Throws InputError for what is compressed, of another storage than sqlite3, listed
/// twice or not there.
Ros2BagFiles files_of_ros2_bag(const std::filesystem::path& folder);

}  // namespace lapservo::internal
