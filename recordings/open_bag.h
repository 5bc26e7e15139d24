#pragma once

#include <memory>
#include <string>

#include "recordings/bag.h"

namespace lapservo::internal {

/// Whether a file or folder is a bag by what it begins with, or means to be one by its name. A session of dvrk_data
/// (session.h) is none, also where its bag's files lie in its own folder.
bool is_bag(const std::string& path);

/// The input itself where it is a bag, else the bag of a session of dvrk_data (session.h); empty for others.
std::string bag_of(const std::string& input);

/// A ROS 1 bag or a folder of its parts, a ROS 2 bag's folder, a .db3 or an .mcap. Throws InputError for what is none,
/// and for what this build lacks the libraries for.
std::shared_ptr<const Bag> open_bag(const std::string& path);

/// A ROS 1 bag (format 2.0, indexed, not encrypted), or a folder of such, in the order of their times. Damaged bags
/// crash librosbag-storage's reader, so this one is our own: it checks every length against the file's size. Throws
/// InputError for other files.
std::unique_ptr<Bag> open_ros1_bag(const std::string& path);

/// A ROS 2 bag: a folder, whose files are read in the order of its metadata.yaml or else of their times, or one .db3 or
/// .mcap of it. Nothing is written there. Throws InputError for what is no such bag, and compressed files.
std::unique_ptr<Bag> open_ros2_bag(const std::string& path);

}  // namespace lapservo::internal
