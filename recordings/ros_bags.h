#pragma once

#include <memory>
#include <string>

#include "recordings/bag.h"

namespace lapservo::internal {

/// A ROS 1 bag (format 2.0, indexed, not encrypted). Damaged bags crash librosbag-storage's reader, so this one is our
/// own: it checks every length against the file's size. Throws InputError for other files.
std::unique_ptr<Bag> open_ros1_bag(const std::string& path);

/// A ROS 2 bag: a folder, whose files are read in the order of its metadata.yaml or else of their times, or one .db3 or
/// .mcap of it. Nothing is written there. Throws InputError for what is no such bag, and compressed files.
std::unique_ptr<Bag> open_ros2_bag(const std::string& path);

}  // namespace lapservo::internal
