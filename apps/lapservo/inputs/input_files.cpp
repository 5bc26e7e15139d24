#include "apps/lapservo/inputs/input_files.h"

#include <optional>
#include <set>
#include <string>
#include <sys/stat.h>
#include <system_error>

#include "lapservo/core/error.h"
#include "lapservo/io/image_file.h"
#include "lapservo/rig/rig_files.h"
#include "recordings/bag_endings.h"

namespace lapservo::app {
namespace {
namespace fs = std::filesystem;

std::optional<std::pair<unsigned long long, unsigned long long>> identity_of(const fs::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return std::nullopt;
  return std::pair<unsigned long long, unsigned long long>(status.st_dev, status.st_ino);
}

}  // namespace

void refuse_shared_place(const std::vector<fs::path>& places) {
  std::set<fs::path> taken;
  std::error_code error;
  for (const fs::path& place : places)
    if (!place.empty() && !taken.insert(fs::weakly_canonical(fs::absolute(place, error), error)).second)
      throw InputError(place.string(), "is the place for two results, expected a place for each");
}

void refuse_other_kind(const fs::path& result, const std::string& ending) {
  static const std::set<std::string> kinds{".csv", ".yaml", ".yml", ".html", ".json", ".mp4",  ".avi", ".mkv",
                                           ".mov", ".png",  ".jpg", ".bag",  ".db3",  ".mcap", ".pdf", ".svg"};
  const std::string own = result.extension() == ".yml" ? ".yaml" : result.extension().string();
  if (own != ending && kinds.contains(own))
    throw InputError(result.string(), "name", own, "one that ends in " + ending);
}

void InputFiles::add(const fs::path& path) {
  if (const auto identity = identity_of(path)) files_.emplace(*identity, path);
}

void InputFiles::add_rig(const fs::path& path, const Rig& rig) {
  add(path);
  internal::each_file(rig, [this](const fs::path& file) { add(file); });
}

void InputFiles::add_recording(const fs::path& path) {
  add(path);
  std::error_code error;
  for (fs::directory_iterator entry(path, error), end; !error && entry != end; entry.increment(error))
    if (has_image_extension(entry->path()) || entry->path().extension() == ".yaml" ||
        internal::ends_like(entry->path().string(), {".bag", ".db3", ".mcap", ".mp4", ".json"}))
      add(entry->path());
}

void InputFiles::refuse_as_output(const fs::path& path) const {
  const auto identity = identity_of(path);
  if (const auto found = identity ? files_.find(*identity) : files_.end(); found != files_.end())
    throw InputError(path.string(),
                     "is the input itself (" + found->second.string() + "), expected another place for the results");
}

void InputFiles::refuse_in_folder(const fs::path& folder) const {
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    const auto identity = identity_of(entry->path());
    if (identity && files_.contains(*identity))
      throw InputError(folder.string(), "holds the input " + entry->path().filename().string() +
                                            ", expected another folder for the results");
  }
}

}  // namespace lapservo::app
