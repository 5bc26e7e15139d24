#include "lapservo/testing/sample_frames.h"

#include <cstdlib>

namespace fs = std::filesystem;

namespace lapservo::testing {

fs::path source_folder() {
  return LAPSERVO_SOURCE_DIR;
}

std::optional<fs::path> sample_frames(std::string_view folder) {
  const char* const given = std::getenv("LAPSERVO_FRAMES");
  const fs::path root = given ? fs::path(given) : source_folder() / ".." / "shared" / "frames";
  std::error_code ignored;
  if (!fs::is_directory(root / folder, ignored)) return std::nullopt;
  return root / folder;
}

}  // namespace lapservo::testing
