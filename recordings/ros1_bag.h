#pragma once

#include <memory>
#include <string>

#include "recordings/bag.h"

namespace lapservo::internal {

/// A ROS 1 bag (format 2.0, indexed, not encrypted). Damaged bags crash librosbag-storage's reader, so this one is our
/// own: it checks every length against the file's size. Throws InputError for other files.
std::unique_ptr<Bag> open_ros1_bag(const std::string& path);

}  // namespace lapservo::internal
