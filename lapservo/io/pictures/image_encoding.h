#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include <opencv2/core.hpp>

namespace lapservo::internal {

/// Whether a file is a JPEG by its ending, in any case.
bool has_jpeg_extension(const std::filesystem::path& name);

/// An image of the kind that `name` says by its ending (has_image_extension()). 8-bit grey or BGR, PNG also alpha and
/// 16 bits; JPEG of quality 95, all others without loss. Throws InputError for anything else.
std::vector<std::uint8_t> encode_image(const std::filesystem::path& name, const cv::Mat& image);

}  // namespace lapservo::internal
