#pragma once

#include <cstdint>
#include <filesystem>
#include <set>
#include <string>

#include "apps/lapservo/inputs/input_files.h"
#include "lapservo/core/file_descriptor.h"
#include "lapservo/core/new_folder.h"
#include "lapservo/rig/rig.h"

namespace lapservo::app {
using namespace internal;

/// The folder of a run's results. They are gathered in its subfolder `unfinished`, and moved up by commit() when they
/// are complete: a run that ends early leaves what was there before, and one that is killed also what it had, in
/// `unfinished`. Each holds rig.yaml, the rig as it was understood, and `.lapservo-run`, which lists the results.
class OutputFolder {
 public:
  /// Makes the folder when there is none. Throws InputError now, before the work, when it can't be made or written, has
  /// less room than `needed_bytes`, holds an input, or holds anything (hidden files apart) without `force`. `force`
  /// lets commit() replace the results of a run, finished or not, and nothing else: there must be one.
  OutputFolder(const std::filesystem::path& path, const Rig& rig, const InputFiles& inputs, bool force,
               std::uintmax_t needed_bytes);

  /// Where to write a result of this name for now.
  std::filesystem::path operator/(const std::string& name) const { return unfinished_.path / name; }
  /// The help on existing folders, common to every run.
  static constexpr auto help =
      "; it must be new or empty, or hold a run that --force replaces; until all is done, and if the run is killed, "
      "what there is stands in its subfolder unfinished";
  static constexpr auto force_help = "Replace a run that is in the folder of --out already; other files there stay";
  /// Throws InputError when a file of a result's name is there that no run has written; the results stay in
  /// `unfinished` then.
  void commit();

 private:
  // Gone in the end with what is in it, unless there are rows that could not be completed, or complete results that
  // could not be moved up.
  struct Unfinished {
    explicit Unfinished(const std::filesystem::path& folder);
    ~Unfinished();
    std::filesystem::path path;
    FileDescriptor lock;
    bool is_complete = false;
  };

  NewFolder folder_;
  std::set<std::string> old_;  // files that may be replaced
  Unfinished unfinished_;
};

}  // namespace lapservo::app
