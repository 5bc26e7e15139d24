#include <cstddef>
#include <cstdint>

#include <opencv2/core/utils/logger.hpp>

#include "fuzz/require.h"
#include "lapservo/io/image_file.h"

// Any bytes are an image in 8-bit BGR, or an InputError. track_fuzz tracks and draws on what an image may show.
extern "C" int LLVMFuzzerInitialize(int*, char***) {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace lapservo;
  fuzz::read_or_refuse([&] {
    const cv::Mat image = decode_image({data, size}, "fuzz.png");
    fuzz::require(image.type() == CV_8UC3 && !image.empty(), "an image is 8-bit BGR");
  });
  return 0;
}
