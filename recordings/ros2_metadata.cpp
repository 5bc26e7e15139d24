#include <algorithm>
#include <string>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include "lapservo/core/error.h"
#include "recordings/bag_endings.h"
#include "recordings/ros2_file.h"

namespace lapservo::internal {
namespace fs = std::filesystem;
namespace {

std::string text_in(const YAML::Node& node, const char* key) {
  return node[key] && node[key].IsScalar() ? node[key].Scalar() : std::string();
}

std::vector<fs::path> files_in(const YAML::Node& information, const fs::path& folder, const std::string& source) {
  if (!information || !information.IsMap())
    throw InputError(source, "has no rosbag2_bagfile_information, expected a ROS 2 bag's: `ros2 bag reindex` makes it");
  if (const std::string storage = text_in(information, "storage_identifier"); storage != "sqlite3" && storage != "mcap")
    throw InputError(source, "storage_identifier", storage, "sqlite3 or mcap: convert it with `ros2 bag convert`");
  if (const std::string format = text_in(information, "compression_format"); !format.empty())
    throw InputError(source, "compression_format", format, "none: convert it with `ros2 bag convert`");
  std::vector<fs::path> files;
  for (const YAML::Node& file : information["relative_file_paths"]) {
    files.push_back(folder / fs::path(file.as<std::string>()).filename());  // some say it with the folder's name
    if (std::find(files.begin(), files.end() - 1, files.back()) != files.end() - 1)
      throw InputError(source, "relative_file_paths", files.back().filename().string(), "each file once");
    std::error_code error;
    if (!fs::is_regular_file(files.back(), error))
      throw InputError(files.back().string(), "does not exist, though " + source + " names it: copy the whole folder");
  }
  if (files.empty()) throw InputError(source, "names no files (relative_file_paths), expected a bag's");
  return files;
}

std::vector<fs::path> unlisted_in(const fs::path& folder, const std::vector<fs::path>& listed) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    if (ends_like_ros2_bag(entry->path().string()) &&
        std::find(listed.begin(), listed.end(), entry->path()) == listed.end())
      files.push_back(entry->path());
  std::sort(files.begin(), files.end());
  return files;
}

// A recorder that was killed leaves no metadata.yaml, and an empty file where it had just begun one.
Ros2BagFiles files_without_metadata(const fs::path& folder) {
  std::vector<fs::path> files = unlisted_in(folder, {});
  std::error_code error;
  std::erase_if(files, [&](const fs::path& file) { return fs::file_size(file, error) == 0; });
  for (const fs::path& file : files)
    if (file.extension() != files.front().extension() || file.extension() == ".zstd")
      throw InputError(folder.string(),
                       "has no metadata.yaml, and compressed files or files of several kinds, expected .mcap or .db3: "
                       "name one of its files, or make it with `ros2 bag reindex`");
  if (files.empty()) throw InputError(folder.string(), "has only empty files, expected a ROS 2 bag's");
  return {std::move(files), "has no metadata.yaml: the times of its files decide their order", true};
}

std::string remark_on(const std::vector<fs::path>& unlisted) {
  if (unlisted.empty()) return {};
  std::vector<std::string> names;
  for (const fs::path& file : unlisted) names.push_back(file.filename().string());
  return fmt::format("metadata.yaml does not list {}: not read; `ros2 bag reindex` lists all files",
                     fmt::join(names, ", "));
}

}  // namespace

Ros2BagFiles files_of_ros2_bag(const fs::path& folder) {
  const fs::path metadata = folder / "metadata.yaml";
  std::error_code error;
  if (!fs::exists(metadata, error)) return files_without_metadata(folder);
  try {
    const YAML::Node information = YAML::LoadFile(metadata.string())["rosbag2_bagfile_information"];
    std::vector<fs::path> files = files_in(information, folder, metadata.string());
    std::string remark = remark_on(unlisted_in(folder, files));
    return {std::move(files), std::move(remark), false};
  } catch (const YAML::Exception& problem) {
    throw InputError(metadata.string(),
                     std::string("can't be read (") + problem.msg + "), expected a ROS 2 bag's YAML");
  }
}

}  // namespace lapservo::internal
