#pragma once

#include <memory>
#include <string>

#include "recordings/bag.h"

namespace lapservo::internal {

/// A ROS 1 bag (format 2.0, indexed, not encrypted). Damaged bags crash librosbag-storage's reader, so this
/// one is our own: no length is believed that the file has not. Throws InputError for what is no
/// such bag.
std::unique_ptr<Bag> open_ros1_bag(const std::string& path);

}  // namespace lapservo::internal
