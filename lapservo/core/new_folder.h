#pragma once

#include <filesystem>
#include <vector>

namespace lapservo::internal {

/// A folder to write into, made with its parents where it is missing. Those made here are removed again when they are
/// empty in the end.
class NewFolder {
 public:
  /// Throws InputError when it can't be made or not be written.
  explicit NewFolder(std::filesystem::path path);
  ~NewFolder();
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  std::vector<std::filesystem::path> made_;  // parents first
};

}  // namespace lapservo::internal
