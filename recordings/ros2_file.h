#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace lapservo::internal {

/// A topic in one file of a ROS 2 bag. Times: since 1970, by the recorder's clock.
struct Ros2FileTopic {
  std::string name, type;  ///< the type as in ROS 2: sensor_msgs/msg/Image
  std::string format;      ///< how its messages are encoded: cdr
  std::uint64_t messages = 0;
  std::uint64_t first_ns = std::numeric_limits<std::uint64_t>::max(), last_ns = 0;  ///< about
};

/// The messages of one topic as they stand in a file, one after the other.
class Ros2FileMessages {
 public:
  virtual ~Ros2FileMessages() = default;
  /// False behind the last one. Throws InputError where the file is damaged.
  virtual bool next() = 0;
  /// Until next().
  virtual std::span<const std::uint8_t> bytes() = 0;
  virtual std::uint64_t recorded_ns() const = 0;
};

/// The port to one file of a ROS 2 bag, of any storage.
class Ros2File {
 public:
  virtual ~Ros2File() = default;
  /// One or several of a name and type.
  virtual const std::vector<Ros2FileTopic>& topics() const = 0;
  /// Where it is not whole; empty where it is.
  virtual std::string remark() const { return {}; }
  /// The messages of all topics of that name and type.
  virtual std::unique_ptr<Ros2FileMessages> messages(const std::string& name, const std::string& type) const = 0;
};

/// Throw InputError for what is no such file.
std::unique_ptr<Ros2File> open_db3_file(const std::string& path);
std::unique_ptr<Ros2File> open_mcap_file(const std::string& path);

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
