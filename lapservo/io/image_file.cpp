#include "lapservo/io/image_file.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <initializer_list>
#include <string_view>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/core/input_file.h"
#include "lapservo/core/lower_case.h"
#include "lapservo/io/pictures/jpeg_picture.h"
#include "lapservo/io/pictures/libav_picture.h"
#include "lapservo/io/pictures/picture_parts.h"
#include "lapservo/io/pictures/png_picture.h"

namespace lapservo {
using namespace internal;
namespace {
namespace fs = std::filesystem;

constexpr std::uint32_t max_side_px = 16384;

struct PictureSize {
  std::uint32_t width_px = 0, height_px = 0;
};

PictureSize png_size(std::span<const std::uint8_t> bytes) {
  const Numbers numbers{bytes, true};
  return {static_cast<std::uint32_t>(numbers.of(16, 4)), static_cast<std::uint32_t>(numbers.of(20, 4))};
}

struct JpegHeader {
  PictureSize size;
  int channels = 0;
};

// Pixels by the first frame header (SOF); zero without one.
JpegHeader jpeg_header(std::span<const std::uint8_t> bytes) {
  for (auto segment = jpeg_segment(bytes, 2); segment; segment = jpeg_segment(bytes, segment->end)) {
    const std::uint8_t marker = segment->marker;
    if (marker < 0xc0 || marker > 0xcf || marker == 0xc4 || marker == 0xc8 || marker == 0xcc) continue;
    const auto number = [&](std::size_t at, std::size_t count) {
      return static_cast<std::uint32_t>(Numbers{segment->content, true}.of(at, count));
    };
    return {{number(3, 2), number(1, 2)}, static_cast<int>(number(5, 1))};
  }
  return {};
}

void check_size(const PictureSize& size, const std::string& source) {
  if (size.width_px > max_side_px || size.height_px > max_side_px)
    throw InputError(source, "size", std::to_string(size.width_px) + "x" + std::to_string(size.height_px),
                     "at most 16384 pixels a side");
}

// Decoders return half an image for half a file, and fill gigabytes for a few bytes: ask for end and size beforehand.
void check_whole(std::span<const std::uint8_t> bytes, PictureFormat format, const std::string& source) {
  const auto need = [&](bool is_whole, const char* name) {
    if (!is_whole) throw InputError(source, fmt::format("is a truncated {}, expected a whole image", name));
  };
  const Numbers numbers{bytes, false};
  if (format == PictureFormat::png) {
    need(bytes.size() >= 33 && text_of(bytes).rfind("IEND") != std::string_view::npos, "PNG");
    check_size(png_size(bytes), source);
  }
  if (format == PictureFormat::jpeg) check_size(jpeg_header(bytes).size, source);
  if (format == PictureFormat::webp) need(bytes.size() >= 8 + numbers.of(4, 4), "WebP");
  if (format == PictureFormat::bmp) need(bytes.size() >= numbers.of(2, 4), "BMP");
}

// "TIFF"; "HEIC" or "AVIF" by the brand that follows the box of the file's type; else empty.
std::string unread_format(std::span<const std::uint8_t> bytes) {
  using namespace std::string_view_literals;
  const std::string_view text = text_of(bytes).substr(0, 12);
  if (text.starts_with("II*\0"sv) || text.starts_with("MM\0*"sv)) return "TIFF";
  if (text.size() < 12 || text.substr(4, 4) != "ftyp") return "";
  const std::string_view brand = text.substr(8);
  if (brand == "avif" || brand == "avis") return "AVIF";
  constexpr std::array<std::string_view, 8> heic{"heic", "heix", "heim", "heis", "hevc", "hevx", "mif1", "msf1"};
  return std::find(heic.begin(), heic.end(), brand) != heic.end() ? "HEIC" : "";
}

void refuse_unread(std::span<const std::uint8_t> bytes, const std::string& source) {
  if (const std::string format = unread_format(bytes); !format.empty())
    throw InputError(source, "is in " + format + ", which is not read: convert it to PNG");
  if (picture_format(bytes) == PictureFormat::jpeg && jpeg_header(bytes).channels == 4)
    throw InputError(source, "is a JPEG in CMYK, which is not read: convert it to PNG in RGB");
}

bool has_extension(const fs::path& path, std::initializer_list<std::string_view> known) {
  return std::find(known.begin(), known.end(), lower_case(path.extension().string())) != known.end();
}

cv::Mat undamaged(const Picture& picture, const std::string& source) {
  if (picture.flaw) throw InputError(source, "is damaged, expected a whole image");
  return picture.bgr;
}

}  // namespace

bool has_image_extension(const fs::path& path) {
  return has_extension(path, {".png", ".jpg", ".jpeg", ".bmp", ".webp", ".ppm", ".pgm"});
}

bool has_jpeg_extension(const fs::path& path) {
  return has_extension(path, {".jpg", ".jpeg"});
}

bool is_written(const fs::path& path) {
  return has_jpeg_extension(path) || has_extension(path, {".png"});
}

bool has_unread_extension(const fs::path& path) {
  return has_extension(path, {".heic", ".heif", ".avif", ".dcm", ".dicom", ".tif", ".tiff"});
}

cv::Mat bgr8_from(const cv::Mat& image, const std::string& source) {
  cv::Mat eight_bit = image;
  if (image.depth() == CV_16U) {
    image.convertTo(eight_bit, CV_8U, 1.0 / 257);
  } else if (image.depth() != CV_8U) {
    throw InputError(source, "pixel type", "floating point or signed", "8 or 16 bits a channel");
  }
  cv::Mat bgr;
  switch (eight_bit.channels()) {
    case 1:
      cv::cvtColor(eight_bit, bgr, cv::COLOR_GRAY2BGR);
      return bgr;
    case 3:
      return eight_bit;
    case 4:
      cv::cvtColor(eight_bit, bgr, cv::COLOR_BGRA2BGR);
      return bgr;
    default:
      throw InputError(source, "channels", std::to_string(eight_bit.channels()), "1 (grey), 3 or 4 (alpha)");
  }
}

Picture decode_picture(std::span<const std::uint8_t> bytes, const std::string& source) {
  if (bytes.empty()) throw InputError(source, "is empty, expected an image");
  const PictureFormat format = picture_format(bytes);
  check_whole(bytes, format, source);
  if (const std::size_t count = picture_count(bytes); count > 1)
    throw InputError(source,
                     "holds " + std::to_string(count) + " images, expected one: write them into a folder, one a file");
  refuse_unread(bytes, source);
  // 0 and numbers above 8 have no meaning in EXIF; they are shown upright everywhere.
  if (const auto orientation = exif_orientation(bytes); orientation && *orientation >= 2 && *orientation <= 8)
    throw InputError(source, "EXIF orientation", std::to_string(*orientation),
                     "1: the pixels as the calibrated camera has them, not to be turned");
  const bool is_png = format == PictureFormat::png, is_jpeg = format == PictureFormat::jpeg;
  const DecodedPicture decoded = is_png ? decode_png(bytes) : is_jpeg ? decode_jpeg(bytes) : libav_decode(bytes);
  if (!decoded.coarse.empty()) throw InputError(source, decoded.coarse);
  if (is_jpeg && !decoded.complaint.empty() && text_of(bytes).rfind("\xff\xd9") == std::string_view::npos)
    throw InputError(source, "is a truncated JPEG, expected a whole image");
  if (decoded.bgr.empty())
    throw InputError(source, "can't be decoded, expected a PNG, JPEG, BMP, WebP, PPM or PGM image");
  check_size({static_cast<std::uint32_t>(decoded.bgr.cols), static_cast<std::uint32_t>(decoded.bgr.rows)}, source);
  Picture picture{bgr8_from(decoded.bgr, source), std::nullopt};
  constexpr std::size_t png_depth = 24;
  const bool is_deep = is_png ? bytes[png_depth] == 16 : decoded.bgr.depth() == CV_16U;
  constexpr double most_of_12_bits = 16;  // of 255
  picture.low_bits = is_deep && cv::norm(picture.bgr, cv::NORM_INF) <= most_of_12_bits;
  if (!decoded.complaint.empty()) picture.flaw = Status::damaged;
  return picture;
}

cv::Mat decode_image(std::span<const std::uint8_t> bytes, const std::string& source) {
  return undamaged(decode_picture(bytes, source), source);
}

Picture read_picture(const fs::path& path) {
  const std::string bytes = read_input(path, max_picture_bytes, "an image");
  return decode_picture({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, path.string());
}

cv::Mat read_image(const fs::path& path) {
  return undamaged(read_picture(path), path.string());
}

void write_image(const fs::path& path, const cv::Mat& image) {
  const auto bytes = has_jpeg_extension(path) ? encode_jpeg(image) : encode_png(image);
  if (bytes.empty() || !is_written(path))
    throw InputError(path.string(), "can't be written as an image, expected a name that ends in .png or .jpg");
  write_file(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace lapservo
