#include "lapservo/core/new_folder.h"

#include <cerrno>
#include <cstring>
#include <string>
#include <sys/stat.h>
#include <unistd.h>

#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

void remove_empty(const std::vector<fs::path>& parents_first) {
  for (auto folder = parents_first.rbegin(); folder != parents_first.rend(); ++folder) ::rmdir(folder->c_str());
}

}  // namespace

NewFolder::NewFolder(fs::path path) : path_(std::move(path)) {
  if (path_.empty()) throw InputError("output", "has no name, expected a folder to write");
  const auto fail = [&](const char* problem, int error) {
    remove_empty(made_);
    throw InputError(path_.string(), std::string(problem) + ": " + std::strerror(error));
  };
  fs::path so_far;
  for (const fs::path& part : path_) {
    so_far /= part;
    if (::mkdir(so_far.c_str(), 0777) == 0) {
      made_.push_back(so_far);
      continue;
    }
    const int error = errno;  // of a folder that is there this may be EEXIST, EROFS, EACCES or EISDIR
    struct stat status {};
    if (::stat(so_far.c_str(), &status) != 0) fail("can't be made a folder", error);
    if (!S_ISDIR(status.st_mode)) fail("can't be made a folder", ENOTDIR);
  }
  if (::access(path_.c_str(), W_OK | X_OK) != 0) fail("can't be written", errno);
}

NewFolder::~NewFolder() {
  remove_empty(made_);
}

}  // namespace lapservo::internal
