#pragma once

#include <memory>
#include <string>

#include "recordings/bag.h"

namespace lapservo::internal {

/// A ROS 2 bag: a folder, whose files are read in the order of its metadata.yaml or else of their times, or one .db3 or
/// .mcap of it. Nothing is written there. Throws InputError for what is no such bag, and compressed files.
std::unique_ptr<Bag> open_ros2_bag(const std::string& path);

}  // namespace lapservo::internal
