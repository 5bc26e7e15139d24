#include "apps/lapservo/output_folder.h"

#include <string>
#include <system_error>

#include <fmt/format.h>

#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"

namespace lapservo::app {
namespace fs = std::filesystem;

void prepare_output_folder(const fs::path& folder, std::uintmax_t needed_bytes) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!fs::is_directory(folder))
    throw InputError(folder.string(),
                     "can't be made a folder" + (error ? ": " + error.message() : std::string(", is a file")));
  AtomicFile probe(folder / "writable");
  const fs::space_info space = fs::space(folder, error);
  if (!error && space.available < needed_bytes)
    throw InputError(folder.string(), fmt::format("has {} MB of room left, expected {} for the results",
                                                  space.available >> 20, needed_bytes >> 20));
}

}  // namespace lapservo::app
