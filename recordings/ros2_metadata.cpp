#include "recordings/ros2_metadata.h"

#include <algorithm>
#include <string>
#include <system_error>

#include <yaml-cpp/yaml.h>

#include "lapservo/core/error.h"
#include "recordings/bag_endings.h"

namespace lapservo::internal {
namespace fs = std::filesystem;
namespace {

std::string text_in(const YAML::Node& node, const char* key) {
  return node[key] && node[key].IsScalar() ? node[key].Scalar() : std::string();
}

std::vector<fs::path> files_in(const YAML::Node& information, const fs::path& folder, const std::string& source) {
  if (!information || !information.IsMap())
    throw InputError(source, "has no rosbag2_bagfile_information, expected a ROS 2 bag's: `ros2 bag reindex` makes it");
  if (const std::string storage = text_in(information, "storage_identifier"); storage != "sqlite3")
    throw InputError(source, "storage_identifier", storage, "sqlite3: convert it with `ros2 bag convert`");
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

}  // namespace

Ros2BagFiles files_of_ros2_bag(const fs::path& folder) {
  const fs::path metadata = folder / "metadata.yaml";
  std::error_code error;
  if (!fs::exists(metadata, error))
    throw InputError(folder.string(),
                     "has no metadata.yaml, expected a ROS 2 bag's: name one of its .db3, or make it with `ros2 bag "
                     "reindex`");
  try {
    Ros2BagFiles files{
        files_in(YAML::LoadFile(metadata.string())["rosbag2_bagfile_information"], folder, metadata.string()), {}};
    files.unlisted = unlisted_in(folder, files.listed);
    return files;
  } catch (const YAML::Exception& problem) {
    throw InputError(metadata.string(),
                     std::string("can't be read (") + problem.msg + "), expected a ROS 2 bag's YAML");
  }
}

}  // namespace lapservo::internal
