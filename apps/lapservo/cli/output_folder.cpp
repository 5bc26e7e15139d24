#include "apps/lapservo/cli/output_folder.h"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <fstream>
#include <sys/stat.h>
#include <system_error>
#include <vector>

#include <fmt/format.h>

#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/rig/rig_writer.h"

namespace lapservo::app {
using namespace internal;
namespace {
namespace fs = std::filesystem;

constexpr auto unfinished_name = "unfinished";
constexpr auto mark_name = ".lapservo-run";  // the names of the results, one a line

// Hidden ones apart.
std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    if (const std::string name = entry->path().filename().string(); !name.starts_with('.')) names.push_back(name);
  if (error) throw InputError(folder.string(), "can't be read: " + error.message());
  return names;
}

bool is_marked(const fs::path& folder) {
  std::error_code error;
  return fs::is_regular_file(folder / mark_name, error);
}

void add_marked_names(const fs::path& folder, std::set<std::string>& names) {
  std::ifstream mark(folder / mark_name);
  for (std::string name; std::getline(mark, name);)
    if (fs::path(name).filename() == name) names.insert(name);
}

FileDescriptor locked(const fs::path& folder, const fs::path& unfinished) {
  FileDescriptor opened(::open(unfinished.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
  if (!opened.is_open())
    throw InputError(folder.string(),
                     std::string("can't be written: ") + unfinished.string() + ": " + std::strerror(errno));
  if (!lock(opened)) throw InputError(folder.string(), "is being written by another run");
  return opened;
}

// The results of earlier runs, which this one may replace: of one that was killed while it moved them, in both places.
std::set<std::string> replaceable(const fs::path& folder, bool force) {
  const auto there = names_in(folder);
  if (there.empty()) return {};
  const fs::path unfinished = folder / unfinished_name;
  std::error_code error;
  const bool stopped = fs::exists(fs::symlink_status(unfinished, error));
  if (stopped) locked(folder, unfinished);
  const bool leftover = stopped && (is_marked(unfinished) || names_in(unfinished).empty());
  if (!leftover && (stopped || !is_marked(folder)))
    throw InputError(folder.string(), "holds " + (stopped ? unfinished_name : there.front()) +
                                          ", which no run has written, expected a new or an empty folder" +
                                          (force ? ", or a run for --force to replace" : ""));
  if (!force)
    throw InputError(folder.string(), std::string(leftover ? "holds a run that was not finished (see its folder "
                                                             "unfinished)"
                                                           : "holds a run already") +
                                          ", expected a new or an empty folder (or --force to replace it)");
  std::set<std::string> names;
  for (const fs::path& marked : {folder, unfinished}) add_marked_names(marked, names);
  fs::remove_all(unfinished, error);
  return names;
}

void check_room(const fs::path& folder, std::uintmax_t needed_bytes) {
  std::error_code error;
  const fs::space_info space = fs::space(folder, error);
  if (!error && space.available < needed_bytes)
    throw InputError(folder.string(), fmt::format("has {} MB of room left, expected {} for the results",
                                                  space.available >> 20, needed_bytes >> 20));
}

std::set<std::string> checked(const fs::path& folder, const InputFiles& inputs, bool force,
                              std::uintmax_t needed_bytes) {
  inputs.refuse_in_folder(folder);
  inputs.refuse_in_folder(folder / unfinished_name);
  check_room(folder, needed_bytes);
  return replaceable(folder, force);
}

void move_up(const fs::path& from, const fs::path& to, const std::string& name) {
  std::error_code error;
  fs::rename(from / name, to / name, error);
  if (error)
    throw InputError((to / name).string(),
                     "can't be written: " + error.message() + "; the results are in " + from.string());
}

}  // namespace

OutputFolder::Unfinished::Unfinished(const fs::path& folder) : path(folder / unfinished_name) {
  if (::mkdir(path.c_str(), 0777) != 0)
    throw InputError(folder.string(), std::string("can't be written: ") + std::strerror(errno));
  lock = locked(folder, path);
}

OutputFolder::Unfinished::~Unfinished() {
  std::error_code error;
  for (fs::directory_iterator entry(path, error), end; !error && entry != end; entry.increment(error))
    if (is_complete || entry->path().extension() == ".part") return;
  fs::remove_all(path, error);
}

OutputFolder::OutputFolder(const fs::path& path, const Rig& rig, const InputFiles& inputs, bool force,
                           std::uintmax_t needed_bytes)
    : folder_(path), old_(checked(folder_.path(), inputs, force, needed_bytes)), unfinished_(folder_.path()) {
  write_file(*this / mark_name, "");
  write_file(*this / "rig.yaml", rig_yaml(rig));
}

// The mark comes last: until then it says in `unfinished` which files of the folder are this run's.
void OutputFolder::commit() {
  const fs::path &folder = folder_.path(), &unfinished = unfinished_.path;
  const std::vector<std::string> fresh = names_in(unfinished);
  std::string listed;
  for (const std::string& name : fresh) listed += name + '\n';
  write_file(unfinished / mark_name, listed);
  unfinished_.is_complete = true;
  std::error_code error;
  for (const std::string& name : fresh)
    if (!old_.contains(name) && fs::exists(fs::symlink_status(folder / name, error)))
      throw InputError((folder / name).string(),
                       "is there, and no run has written it: the results are in " + unfinished.string());
  for (const std::string& name : fresh) move_up(unfinished, folder, name), old_.erase(name);
  for (const std::string& name : old_) fs::remove(folder / name, error);
  move_up(unfinished, folder, mark_name);
}

}  // namespace lapservo::app
