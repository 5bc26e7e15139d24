#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

namespace lapservo::internal {

/// The whole content of a file that others wrote. A pipe or device is read to its end, as long as it gives something
/// every five seconds. Throws InputError, naming what was `expected` ("a picture"), when it is a folder, can't be
/// opened, holds more than `max_bytes` or gives nothing for five seconds.
std::string read_input(const std::filesystem::path& path, std::size_t max_bytes, std::string_view expected);

}  // namespace lapservo::internal
