#include "apps/lapservo/inputs/frame_input.h"

#include <utility>

#include "apps/lapservo/cli/interrupt.h"
#include "cameras/camera.h"
#include "lapservo/core/error.h"
#include "lapservo/io/video/read_ahead.h"
#include "recordings/bag_frames.h"
#include "recordings/open_bag.h"

namespace lapservo::app {
using namespace internal;

std::unique_ptr<FrameSource> open_frames(const std::string& input, double folder_fps, const std::string& image_topic,
                                         const Camera* camera, bool deinterlace) {
  if (is_bag(input)) return read_ahead(std::make_unique<BagFrames>(open_bag(input), image_topic));
  refuse_topic_outside_bags("--image-topic", image_topic, input);
  const cv::Size size = camera ? cv::Size(camera->width_px, camera->height_px) : cv::Size();
  const bool deinterlaced = deinterlace || (camera && camera->deinterlace);
  auto source = open_camera_or_file(input, folder_fps, size, interrupted, deinterlaced);
  return source->kind() == FrameSource::Kind::live ? std::move(source) : read_ahead(std::move(source));
}

void refuse_topic_outside_bags(const std::string& option, const std::string& topic, const std::string& input) {
  if (!topic.empty()) throw InputError(option, "is " + topic + ", which is for bags, and " + input + " is none");
}

void add_image_topic_option(Command command, std::string& image_topic) {
  command.add_option("--image-topic", image_topic, "Of a bag with several: the topic whose images are meant");
}

}  // namespace lapservo::app
