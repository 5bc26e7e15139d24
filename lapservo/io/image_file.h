#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include <opencv2/core.hpp>

#include "lapservo/vision/observation.h"

namespace lapservo {

/// Whether the name ends like an image's (png, jpg, jpeg, bmp, webp, ppm, pgm).
bool has_image_extension(const std::filesystem::path& path);

/// Whether the name ends like a JPEG's (jpg, jpeg).
bool has_jpeg_extension(const std::filesystem::path& path);

/// Whether write_image() writes what is named so: PNG or JPEG.
bool is_written(const std::filesystem::path& path);

/// Whether the name ends like that of an image in TIFF, HEIC, AVIF or DICOM, which are not read.
bool has_unread_extension(const std::filesystem::path& path);

/// An image in 8-bit BGR, and why nothing is to be measured in it: `damaged` when its decoder complained.
struct Picture {
  cv::Mat bgr;
  std::optional<Status> flaw;
  bool low_bits = false;  ///< 16 bits a channel, of which the values use no more than the lower 12
};

/// Decodes an image. Light that a PNG names by cICP or gAMA is read as sRGB; grey is repeated over the channels, alpha
/// dropped, 16-bit rounded to 8. Throws InputError for anything that isn't a whole image of the camera's pixels: empty,
/// larger than 256 MiB, truncated (PNG without its end chunk), not decodable, of several images, TIFF, HEIC, CMYK,
/// with a palette or fewer than 5 bits a channel, other pixel types, or to be turned by EXIF, as a calibration belongs
/// to the pixels in one orientation and it is unknown to which.
Picture read_picture(const std::filesystem::path& path);
Picture decode_picture(std::span<const std::uint8_t> bytes, const std::string& source);

/// The same of images whose decoder does not complain: else InputError.
cv::Mat read_image(const std::filesystem::path& path);
cv::Mat decode_image(std::span<const std::uint8_t> bytes, const std::string& source);

/// 8-bit BGR of any supported pixel type, as above.
cv::Mat bgr8_from(const cv::Mat& image, const std::string& source);

/// A PNG or JPEG by the ending of the name, whole or not at all: see write_file(). 8-bit grey or BGR, PNG also alpha
/// and 16 bits; JPEG of quality 95. Throws InputError for anything else, and when that fails.
void write_image(const std::filesystem::path& path, const cv::Mat& image);
}  // namespace lapservo
