#pragma once

#include <filesystem>

#include <opencv2/core.hpp>

#include "lapservo/core/atomic_file.h"

namespace lapservo::internal {

/// write_image() into a file that is open already; `name` says the format by its ending.
void write_open_image(AtomicFile& file, const std::filesystem::path& name, const cv::Mat& image);

}  // namespace lapservo::internal
