#include "lapservo/io/image_encoding.h"

#include <cstdint>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "lapservo/core/error.h"
#include "lapservo/io/image_file.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

std::vector<std::uint8_t> encode_image(const fs::path& name, const cv::Mat& image) {
  std::vector<std::uint8_t> bytes;
  try {
    if (has_image_extension(name) && cv::imencode(name.extension().string(), image, bytes)) return bytes;
  } catch (const cv::Exception&) {
  }
  throw InputError(name.string(), "can't be written as a picture");
}

}  // namespace

void write_open_image(AtomicFile& file, const fs::path& name, const cv::Mat& image) {
  const auto bytes = encode_image(name, image);
  file.stream().write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  file.commit();
}

}  // namespace lapservo::internal
