#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
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

  void count(std::uint64_t more, std::uint64_t of_first_ns, std::uint64_t of_last_ns) {
    messages += more;
    first_ns = std::min(first_ns, of_first_ns), last_ns = std::max(last_ns, of_last_ns);
  }
};

struct Ros2RawMessage {
  std::uint64_t recorded_ns = 0;
  std::span<const std::uint8_t> bytes;  ///< until the next one
};
/// The messages of one topic as they stand in a file, one after the other; nullopt behind the last one. Throws
/// InputError where the file is damaged.
using Ros2FileMessages = std::function<std::optional<Ros2RawMessage>()>;

/// The port to one file of a ROS 2 bag, of any storage.
class Ros2File {
 public:
  virtual ~Ros2File() = default;
  /// One or several of a name and type.
  const std::vector<Ros2FileTopic>& topics() const { return topics_; }
  /// Where it is not whole; empty where it is.
  const std::string& remark() const { return remark_; }
  /// The messages of all topics of that name and type.
  virtual Ros2FileMessages messages(const std::string& name, const std::string& type) const = 0;

 protected:
  std::string remark_;
  std::vector<Ros2FileTopic> topics_;
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
