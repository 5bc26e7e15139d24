#pragma once

#include <filesystem>
#include <vector>

namespace lapservo::internal {

/// The .db3 files of a ROS 2 bag's folder, in the order of its metadata.yaml. Throws InputError for what is compressed,
/// of another storage than sqlite3, or not there.
std::vector<std::filesystem::path> files_of_ros2_bag(const std::filesystem::path& folder);

}  // namespace lapservo::internal
