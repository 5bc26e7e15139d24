#pragma once

#include <memory>
#include <string>

#include "recordings/bag.h"

namespace lapservo::internal {

/// A ROS 2 bag: a folder with metadata.yaml, whose files are read in its order, or one .db3 of it. Nothing is written
/// there. Throws InputError for what is no such bag, compressed ones and those of another storage than sqlite3.
std::unique_ptr<Bag> open_ros2_bag(const std::string& path);

}  // namespace lapservo::internal
