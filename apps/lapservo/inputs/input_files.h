#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "lapservo/rig/rig.h"

namespace lapservo::app {

/// Throws InputError when two results would have one place; an empty one is none.
void refuse_shared_place(const std::vector<std::filesystem::path>& places);

/// Throws InputError for a result whose name ends as a file of another kind does: a table `rig.yaml` would replace a
/// rig. `ending`: ".csv" for example; an empty name is none.
void refuse_other_kind(const std::filesystem::path& result, const std::string& ending);

/// The regular files that a command reads, so that none of them is written over, by whatever name or link.
class InputFiles {
 public:
  /// Anything but a regular file is passed over.
  void add(const std::filesystem::path& path);
  /// The file and the camera's, where the rig has one.
  void add_rig(const std::filesystem::path& path, const Rig& rig);
  /// A file, or the images in a folder and the rigs beside them, or a bag's files.
  void add_recording(const std::filesystem::path& path);

  /// Throws InputError when the file is one of them.
  void refuse_as_output(const std::filesystem::path& path) const;
  /// Throws InputError when the folder holds one of them, or a link to one.
  void refuse_in_folder(const std::filesystem::path& folder) const;

 private:
  std::map<std::pair<unsigned long long, unsigned long long>, std::filesystem::path> files_;  // by device and inode
};

}  // namespace lapservo::app
