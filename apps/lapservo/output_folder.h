#pragma once

#include <filesystem>

namespace lapservo::app {

/// Makes the folder when there is none. Throws InputError now, before the work, when it can't be made or written or has
/// less room than `needed_bytes`.
void prepare_output_folder(const std::filesystem::path& folder, std::uintmax_t needed_bytes);

}  // namespace lapservo::app
