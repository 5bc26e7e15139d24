#include <cstddef>
#include <cstdint>

#include <opencv2/core/utils/logger.hpp>

#include "fuzz/require_observation.h"
#include "fuzz/small_rig.h"
#include "lapservo/io/image_file.h"
#include "lapservo/io/overlay.h"
#include "lapservo/vision/tracker.h"

// Any bytes are an image in 8-bit BGR that can be tracked and drawn on, or an InputError.
namespace {
using namespace lapservo;
using fuzz::require;

// Made once: its table of colours takes longer than a frame.
struct TrackedPicture {
  Rig rig;
  Tracker tracker;

  explicit TrackedPicture(Method method) : rig(of_picture_size()), tracker(rig, {.method = method, .single = true}) {}
  static Rig of_picture_size() {
    Rig rig = fuzz::small_rig(true, false);
    rig.camera.width_px = 32, rig.camera.height_px = 24;
    return rig;
  }
  void track(const cv::Mat& image) {
    const auto& observations = tracker.track(image);
    require(observations.size() == rig.instruments.size(), "one observation an instrument");
    for (const Observation& observation : observations) fuzz::require_sound(observation);
    require(draw_overlay(image, rig, observations).size() == image.size(), "an overlay has its image's size");
  }
};

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const cv::Mat image = decode_image({data, size}, "fuzz.png");
    require(image.type() == CV_8UC3 && !image.empty(), "an image is 8-bit BGR");
    static TrackedPicture surface(Method::surface), centerline(Method::centerline);
    surface.track(image);  // an InputError unless it has the rig's size
    centerline.track(image);
  } catch (const InputError& error) {
    fuzz::require_one_line(error);
  }
  return 0;
}
