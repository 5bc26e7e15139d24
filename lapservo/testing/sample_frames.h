#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string_view>

namespace lapservo::testing {

inline std::filesystem::path source_folder() {
  return LAPSERVO_SOURCE_DIR;
}

/// A folder of the ray-traced sample frames, in $LAPSERVO_FRAMES or beside the repository; nullopt when it is not
/// there, upon which a test that needs it should GTEST_SKIP().
inline std::optional<std::filesystem::path> sample_frames(std::string_view folder) {
  const char* const given = std::getenv("LAPSERVO_FRAMES");
  const std::filesystem::path root =
      given ? std::filesystem::path(given) : source_folder() / ".." / "shared" / "frames";
  std::error_code ignored;
  if (!std::filesystem::is_directory(root / folder, ignored)) return std::nullopt;
  return root / folder;
}

}  // namespace lapservo::testing
