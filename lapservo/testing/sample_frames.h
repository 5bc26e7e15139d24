#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

namespace lapservo::testing {

/// The root of the source tree.
std::filesystem::path source_folder();

/// A folder of the ray-traced sample frames, in $LAPSERVO_FRAMES or beside the repository; nullopt when it is not
/// there, upon which a test that needs it should GTEST_SKIP().
std::optional<std::filesystem::path> sample_frames(std::string_view folder = {});

}  // namespace lapservo::testing
