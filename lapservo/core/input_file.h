#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

namespace lapservo::internal {

/// Reads the whole content of a file of another program. A pipe or device is read to its end, as long as it delivers
/// something every five seconds. Throws InputError, naming the `expected` content ("an image"), for a folder, a file
/// that can't be opened, more than `max_bytes`, or five seconds without data.
std::string read_input(const std::filesystem::path& path, std::size_t max_bytes, std::string_view expected);

}  // namespace lapservo::internal
