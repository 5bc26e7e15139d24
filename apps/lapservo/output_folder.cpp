#include "apps/lapservo/output_folder.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <fstream>
#include <string_view>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>
#include <vector>

#include <fmt/format.h>

#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/core/temporary_file.h"
#include "lapservo/rig/rig_writer.h"

namespace lapservo::app {
using namespace internal;
namespace {
namespace fs = std::filesystem;

constexpr std::string_view heading = "# Written by lapservo: the rig of the results in this folder.";
constexpr auto unfinished_name = "unfinished", replaced_name = "replaced";  // the latter within the former

[[noreturn]] void fail(const fs::path& path, const std::error_code& error) {
  throw InputError(path.string(), "can't be written: " + error.message());
}

// What any run writes: servo, render, experiment.
bool is_result(const std::string& name) {
  static constexpr std::array<std::string_view, 7> names{"rig.yaml",  "controller.yaml", "log.csv",    "log.csv.part",
                                                         "truth.csv", "video.mp4",       "report.html"};
  static constexpr std::array<std::string_view, 4> experiments{"illumination", "rcm", "rotation", "tracking"};
  if (std::find(names.begin(), names.end(), name) != names.end()) return true;
  if (name.ends_with(".csv"))
    return std::any_of(experiments.begin(), experiments.end(),
                       [&](std::string_view experiment) { return name.starts_with(experiment); });
  const auto digits = name.find_first_not_of("0123456789");
  return digits != std::string::npos && digits >= 4 && (name.substr(digits) == ".png" || name.substr(digits) == ".jpg");
}

// Hidden ones apart.
std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    if (const std::string name = entry->path().filename().string(); !name.starts_with('.')) names.push_back(name);
  if (error) throw InputError(folder.string(), "can't be read: " + error.message());
  return names;
}

bool holds_run(const fs::path& folder) {
  std::error_code error;
  std::ifstream file(folder / "rig.yaml");
  std::string line(heading.size(), '\0');
  return fs::is_regular_file(folder / "rig.yaml", error) &&
         file.read(line.data(), static_cast<std::streamsize>(line.size())) && line == heading;
}

FileDescriptor locked(const fs::path& folder, const fs::path& unfinished) {
  FileDescriptor opened(::open(unfinished.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
  if (!opened.is_open())
    throw InputError(folder.string(),
                     std::string("can't be written: ") + unfinished.string() + ": " + std::strerror(errno));
  if (!lock(opened)) throw InputError(folder.string(), "is being written by another run");
  return opened;
}

void refuse_existing(const fs::path& folder, bool force) {
  const auto names = names_in(folder);
  if (names.empty()) return;
  const fs::path unfinished = folder / unfinished_name;
  std::error_code error;
  const bool stopped = fs::exists(fs::symlink_status(unfinished, error));
  if (stopped) locked(folder, unfinished);
  const bool leftover = holds_run(unfinished) || (stopped && fs::is_empty(unfinished, error));
  if (!leftover && !holds_run(folder))
    throw InputError(folder.string(), "holds " + names.front() + ", expected a new or an empty folder" +
                                          (force ? ", or a run for --force to replace" : ""));
  if (!force)
    throw InputError(folder.string(), leftover ? "holds a run that was not finished (see its folder unfinished), "
                                                 "expected a new or an empty folder (or --force to replace it)"
                                               : "holds a run already, expected a new or an empty folder (or --force "
                                                 "to replace it)");
  if (stopped && !leftover && !names_in(unfinished).empty())
    throw InputError(folder.string(), "holds unfinished, which no run has written, expected a new or an empty folder");
  fs::remove_all(unfinished, error);
}

void check_room(const fs::path& folder, std::uintmax_t needed_bytes) {
  std::error_code error;
  const fs::space_info space = fs::space(folder, error);
  if (!error && space.available < needed_bytes)
    throw InputError(folder.string(), fmt::format("has {} MB of room left, expected {} for the results",
                                                  space.available >> 20, needed_bytes >> 20));
}

const fs::path& checked(const fs::path& folder, const InputFiles& inputs, bool force, std::uintmax_t needed_bytes) {
  inputs.refuse_in_folder(folder);
  inputs.refuse_in_folder(folder / unfinished_name);
  refuse_existing(folder, force);
  check_room(folder, needed_bytes);
  return folder;
}

void move_up(const fs::path& from, const fs::path& to, const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    std::error_code error;
    fs::rename(from / name, to / name, error);
    if (error) fail(to / name, error);
  }
}

}  // namespace

OutputFolder::Unfinished::Unfinished(const fs::path& folder) : path(folder / unfinished_name) {
  if (::mkdir(path.c_str(), 0777) != 0) fail(folder, {errno, std::generic_category()});
  lock = locked(folder, path);
}

OutputFolder::Unfinished::~Unfinished() {
  std::error_code error;
  for (fs::directory_iterator entry(path, error), end; !error && entry != end; entry.increment(error))
    if (entry->path().extension() == ".part" || entry->path().filename() == replaced_name) return;
  fs::remove_all(path, error);
}

OutputFolder::OutputFolder(const fs::path& path, const Rig& rig, const InputFiles& inputs, bool force,
                           std::uintmax_t needed_bytes)
    : folder_(path), unfinished_(checked(folder_.path(), inputs, force, needed_bytes)) {
  write_file(*this / "rig.yaml", fmt::format("{}\n{}", heading, rig_yaml(rig)));
}

void OutputFolder::commit() {
  const fs::path &folder = folder_.path(), replaced = unfinished_.path / replaced_name;
  std::vector<std::string> old, fresh = names_in(unfinished_.path);
  for (const std::string& name : names_in(folder))
    if (is_result(name)) old.push_back(name);
  // rig.yaml comes last, so that `unfinished` is known for ours should we be killed at this very point.
  std::partition(fresh.begin(), fresh.end(), [](const std::string& name) { return name != "rig.yaml"; });
  std::error_code error;
  if (!old.empty() && !fs::create_directory(replaced, error)) fail(folder, error);
  move_up(folder, replaced, old);
  move_up(unfinished_.path, folder, fresh);
  fs::remove_all(replaced, error);
}

}  // namespace lapservo::app
