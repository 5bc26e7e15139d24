#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include <opencv2/core.hpp>

#include "lapservo/core/atomic_file.h"

namespace lapservo {

/// Whether the name ends like a picture's (png, jpg, jpeg, bmp, tif, tiff, webp, ppm, pgm).
bool has_image_extension(const std::filesystem::path& path);

/// Decodes a picture to 8-bit BGR. Grey is repeated over the channels, alpha dropped, 16-bit rounded to 8; EXIF
/// rotation is ignored, as the camera's calibration refers to the pixels as stored. Throws InputError for anything that
/// isn't a whole picture: empty, truncated (PNG without its end chunk, JPEG without its end marker), not decodable,
/// other pixel types.
cv::Mat read_image(const std::filesystem::path& path);
cv::Mat decode_image(std::span<const std::uint8_t> bytes, const std::string& source);

/// 8-bit BGR of any supported pixel type, as above.
cv::Mat bgr8_from(const cv::Mat& image, const std::string& source);

/// Writes whole or not at all: see AtomicFile. Throws InputError when that fails.
void write_image(const std::filesystem::path& path, const cv::Mat& image);
/// The same into a file that is open already; `name` says the format by its ending.
void write_image(AtomicFile& file, const std::filesystem::path& name, const cv::Mat& image);

}  // namespace lapservo
