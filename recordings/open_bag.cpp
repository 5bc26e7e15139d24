#include "recordings/open_bag.h"

#include <filesystem>
#include <system_error>

#include "lapservo/core/error.h"
#include "lapservo/io/image_file.h"
#include "recordings/bag_endings.h"
#ifdef LAPSERVO_BAGS
#include "recordings/session.h"
#endif

namespace lapservo::internal {
namespace fs = std::filesystem;
namespace {

enum class BagKind { none, ros1, ros2, compressed };

BagKind kind_of_file(const std::string& path) {
  if (begins_like(path, "#ROSBAG ")) return BagKind::ros1;
  if (begins_like(path, "SQLite format 3") || is_mcap(path)) return BagKind::ros2;
  if (ends_like(path, {".db3.zstd", ".mcap.zstd", ".bag.zst", ".db3.zst", ".mcap.zst"})) return BagKind::compressed;
  if (ends_like_ros1_bag(path)) return BagKind::ros1;
  return ends_like(path, {".db3"}) ? BagKind::ros2 : BagKind::none;
}

// Recognises a bag by its content, so that images may have a metadata.yaml, or a ROS 1 bag with their joints, beside
// them.
BagKind kind_of_folder(const std::string& path) {
  bool has_ros1 = false, has_images = false;
  std::error_code error;
  for (fs::directory_iterator entry(path, error), end; !error && entry != end; entry.increment(error)) {
    if (ends_like_ros2_bag(entry->path().string())) return BagKind::ros2;
    has_ros1 |= ends_like_ros1_bag(entry->path().string());
    has_images |= has_image_extension(entry->path());
  }
  return has_ros1 && !has_images ? BagKind::ros1 : BagKind::none;
}

BagKind kind_of(const std::string& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) return kind_of_folder(path);
  return fs::is_regular_file(path, error) ? kind_of_file(path) : BagKind::none;
}

#ifndef LAPSERVO_BAGS
bool is_session(const std::string&) {
  return false;
}
#endif

}  // namespace

bool is_bag(const std::string& path) {
  return !is_session(path) && kind_of(path) != BagKind::none;
}

std::string bag_of(const std::string& input) {
#ifdef LAPSERVO_BAGS
  if (is_session(input)) return bag_of_session(input);
#endif
  return is_bag(input) ? input : std::string();
}

std::shared_ptr<const Bag> open_bag(const std::string& path) {
  const BagKind kind = kind_of(path);
  if (kind == BagKind::none)
    throw InputError(
        path, "is no bag, expected a ROS 1 bag or a folder of its parts, a ROS 2 bag's folder, a .db3 or an .mcap");
  if (kind == BagKind::compressed)
    throw InputError(path, "is compressed, expected a .db3 or .mcap: unpack it with `zstd -d`");
#ifdef LAPSERVO_BAGS
  if (kind == BagKind::ros1) return open_ros1_bag(path);
  return open_ros2_bag(path);
#else
  throw InputError(path, "is a bag, which this build lacks: it was built without all of " LAPSERVO_BAG_PACKAGES);
#endif
}

}  // namespace lapservo::internal
