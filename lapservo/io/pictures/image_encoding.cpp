#include "lapservo/io/pictures/image_encoding.h"

#include "lapservo/core/error.h"
#include "lapservo/core/lower_case.h"
#include "lapservo/io/pictures/jpeg_encoding.h"
#include "lapservo/io/pictures/libav_picture.h"
#include "lapservo/io/pictures/png_encoding.h"

namespace lapservo::internal {
namespace fs = std::filesystem;

namespace {

bool is_jpeg_extension(const std::string& extension) {
  return extension == ".jpg" || extension == ".jpeg";
}

std::vector<std::uint8_t> encoded_as(const std::string& extension, const cv::Mat& image) {
  if (extension == ".png") return encode_png(image);
  if (is_jpeg_extension(extension)) return encode_jpeg(image);
  return libav_encode(extension, image);
}

}  // namespace

bool has_jpeg_extension(const fs::path& name) {
  return is_jpeg_extension(lower_case(name.extension().string()));
}

std::vector<std::uint8_t> encode_image(const fs::path& name, const cv::Mat& image) {
  const std::string extension = lower_case(name.extension().string());
  const auto bytes = encoded_as(extension, image);
  if (bytes.empty()) throw InputError(name.string(), "can't be written as an image");
  return bytes;
}

}  // namespace lapservo::internal
