#include "recordings/open_bag.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <system_error>

#include "lapservo/core/error.h"
#include "recordings/bag_endings.h"
#ifdef LAPSERVO_ROS1_BAGS
#include "recordings/ros1_bag.h"
#endif
#ifdef LAPSERVO_ROS2_BAGS
#include "recordings/ros2_bag.h"
#endif

namespace lapservo::internal {
namespace fs = std::filesystem;
namespace {

enum class BagKind { none, ros1, ros2, mcap, compressed };

BagKind kind_of_file(const std::string& path) {
  std::array<char, 16> begin{};
  std::ifstream(path, std::ios::binary).read(begin.data(), begin.size());
  const std::string_view text(begin.data(), begin.size());
  if (text.starts_with("#ROSBAG ")) return BagKind::ros1;
  if (text.starts_with("SQLite format 3")) return BagKind::ros2;
  if (text.starts_with("\x89MCAP")) return BagKind::mcap;
  if (ends_like(path, {".db3.zstd", ".mcap.zstd", ".bag.zst", ".db3.zst"})) return BagKind::compressed;
  if (ends_like(path, {".bag", ".bag.active"})) return BagKind::ros1;
  if (ends_like(path, {".mcap"})) return BagKind::mcap;
  return ends_like(path, {".db3"}) ? BagKind::ros2 : BagKind::none;
}

// Recognises a bag by its content, so that images may have a metadata.yaml of their own.
BagKind kind_of_folder(const std::string& path) {
  std::error_code error;
  for (fs::directory_iterator entry(path, error), end; !error && entry != end; entry.increment(error))
    if (ends_like_ros2_bag(entry->path().string())) return BagKind::ros2;
  return BagKind::none;
}

BagKind kind_of(const std::string& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) return kind_of_folder(path);
  return fs::is_regular_file(path, error) ? kind_of_file(path) : BagKind::none;
}

[[noreturn]] [[maybe_unused]] void refuse_missing(const std::string& path, const std::string& what,
                                                  const std::string& packages) {
  throw InputError(path, "is a " + what + ", which this build lacks: it was built without " + packages);
}

}  // namespace

bool is_bag(const std::string& path) {
  return kind_of(path) != BagKind::none;
}

std::shared_ptr<const Bag> open_bag(const std::string& path) {
  switch (kind_of(path)) {
    case BagKind::ros1:
#ifdef LAPSERVO_ROS1_BAGS
      return open_ros1_bag(path);
#else
      refuse_missing(path, "ROS 1 bag", "libbz2-dev and liblz4-dev");
#endif
    case BagKind::ros2:
#ifdef LAPSERVO_ROS2_BAGS
      return open_ros2_bag(path);
#else
      refuse_missing(path, "ROS 2 bag", "libsqlite3-dev");
#endif
    case BagKind::mcap:
      throw InputError(path, "is an MCAP recording, expected a .db3: convert it with `ros2 bag convert`");
    case BagKind::compressed:
      throw InputError(path, "is compressed, expected a .db3: unpack it with `zstd -d`");
    case BagKind::none:
      break;
  }
  throw InputError(path, "is no bag, expected a ROS 1 bag, a ROS 2 bag's folder or a .db3");
}

}  // namespace lapservo::internal
