#include "apps/lapservo/inputs/frame_input.h"

#include <cstdio>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "apps/lapservo/cli/interrupt.h"
#include "cameras/camera.h"
#include "lapservo/calibration/recording/frame_recording.h"
#include "lapservo/core/error.h"
#include "lapservo/io/frame_filter.h"
#include "lapservo/io/video/read_ahead.h"
#include "lapservo/io/video/video_reader.h"
#include "recordings/bag_frames.h"
#include "recordings/open_bag.h"
#include "recordings/session.h"

namespace lapservo::app {
using namespace internal;

void say_remark(const std::string& input, const std::string& remark) {
  static std::set<std::pair<std::string, std::string>> said;  // instruments, the arm and its wrist share recordings
  if (!remark.empty() && said.emplace(input, remark).second)
    std::fprintf(stderr, "lapservo: %s: %s\n", input.c_str(), remark.c_str());
}

namespace {

// One half of each frame, which shows both eyes of an endoscope side by side; `name`: of the source. Throws InputError
// where their width is odd.
class HalfFrames : public FrameFilter {
 public:
  HalfFrames(std::unique_ptr<FrameSource> source, bool is_left, std::string name)
      : FrameFilter(std::move(source)), is_left_(is_left), name_(std::move(name)) {}

  std::optional<Frame> next() override {
    auto frame = FrameFilter::next();
    if (!frame || frame->bgr.empty()) return frame;
    if (frame->bgr.cols % 2 != 0)
      throw InputError(name_, "has frames of " + std::to_string(frame->bgr.cols) +
                                  " columns, expected an even number: two eyes side by side");
    const int width = frame->bgr.cols / 2;
    frame->bgr = frame->bgr.colRange(is_left_ ? 0 : width, is_left_ ? width : 2 * width).clone();
    return frame;
  }

 private:
  bool is_left_;
  std::string name_;
};

// `layout`: LR or RL where the input says that it has both eyes.
std::unique_ptr<FrameSource> of_one_eye(std::unique_ptr<FrameSource> frames, const std::string& input,
                                        const FrameOptions& options, const std::string& layout) {
  const std::string& order = options.side_by_side.empty() ? layout : options.side_by_side;
  if (options.eye.empty() && order.empty()) return frames;
  if (options.eye.empty())
    throw InputError("--eye",
                     "is missing, expected left or right: " + input + " has both eyes side by side (" + order + ")");
  const bool is_first = (options.eye == "left") == (order != "RL");
  return std::make_unique<HalfFrames>(std::move(frames), is_first, input);
}

// Says which options an input leaves without an effect. `has_chroma`: whether it may be a video in YCbCr.
void say_ignored(const std::string& input, const FrameOptions& options, FrameSource::Kind kind, bool has_chroma) {
  if (options.fps && kind != FrameSource::Kind::folder && kind != FrameSource::Kind::image)
    say_remark(input, fmt::format("--fps {} is ignored: it is for folders of images", *options.fps));
  if (!has_chroma && !(options.colour_matrix + options.chroma_location).empty())
    say_remark(input, ignored_colours_text);
}

// With the layout of both eyes, where the input says it.
std::pair<std::unique_ptr<FrameSource>, std::string> open_whole(const std::string& input, const FrameOptions& options,
                                                                const Camera* camera) {
  const VideoReading reading{options.deinterlace || (camera && camera->deinterlace), options.colour_matrix,
                             options.chroma_location};
  if (is_bag(input)) {
    auto frames = std::make_unique<BagFrames>(open_bag(input), options.image_topic);
    say_if_undistorted(frames->topic(), camera);
    say_ignored(input, options, frames->kind(), false);
    return {std::move(frames), std::string()};
  }
#ifdef LAPSERVO_BAGS
  if (is_session(input)) {
    auto [frames, layout] = open_session(input, options.image_topic, reading);
    say_ignored(input, options, frames->kind(), true);
    return {std::move(frames), std::move(layout)};
  }
#endif
  refuse_topic_outside_bags("--image-topic", options.image_topic, input);
  const int eyes = options.eye.empty() ? 1 : 2;
  const cv::Size size = camera ? cv::Size(eyes * camera->width_px, camera->height_px) : cv::Size();
  auto frames = open_camera_or_file(input, options.fps.value_or(FrameOptions::usual_fps), size, interrupted, reading);
  const FrameSource::Kind kind = frames->kind();
  const bool is_video = kind == FrameSource::Kind::video || (kind == FrameSource::Kind::live && !names_camera(input));
  say_ignored(input, options, kind, is_video);
  return {std::move(frames), std::string()};
}

}  // namespace

std::unique_ptr<FrameSource> open_frames(const std::string& input, const FrameOptions& options, const Camera* camera) {
  auto [whole, layout] = open_whole(input, options, camera);
  auto source = of_one_eye(std::move(whole), input, options, layout);
  if (camera) expect_srgb(source->is_srgb(), input, camera->response);
  say_remark(input, source->remark());
  return source->kind() == FrameSource::Kind::live ? std::move(source) : read_ahead(std::move(source));
}

void say_if_undistorted(const std::string& topic, const Camera* camera) {
  if (!camera || !camera->distorted() || topic.find("image_rect") == std::string::npos) return;
  std::fprintf(stderr,
               "lapservo: %s: its images are undistorted by its name, but the rig's camera has "
               "distortion_coefficients: take the raw topic (image_raw), or a rig of the undistorted camera\n",
               topic.c_str());
}

void refuse_topic_outside_bags(const std::string& option, const std::string& topic, const std::string& input) {
  if (!topic.empty()) throw InputError(option, "is " + topic + ", which is for bags, and " + input + " is none");
}

void add_image_topic_option(Command command, std::string& image_topic) {
  command.add_option("--image-topic", image_topic,
                     "In a bag with several: the topic of the images; in a session of dvrk_data: the stream");
}

void add_eye_options(Command command, FrameOptions& options) {
  command.add_option("--eye", options.eye, one_of({"left", "right"}),
                     "The eye that is the rig's camera, where frames have both of an endoscope side by side");
  command.add_option("--side-by-side", options.side_by_side, one_of({"LR", "RL"}),
                     "With --eye: which eye is on the left of the frames (LR: the left one); else as a session of "
                     "dvrk_data says, or LR");
}

void add_video_options(Command command, FrameOptions& options) {
  add_eye_options(command, options);
  command.add_option("--colour-matrix", options.colour_matrix, one_of({"bt601", "bt709", "bt2020"}),
                     "Colour matrix of a video, in the place of its own");
  command.add_option("--chroma-location", options.chroma_location, one_of({"left", "centre", "top-left"}),
                     "Place of the samples of chroma of a video, whatever it names; else as it names");
}

std::vector<std::string> frame_option_names() {
  return {"--image-topic", "--eye", "--side-by-side", "--colour-matrix", "--chroma-location", "--fps", "--deinterlace"};
}

}  // namespace lapservo::app
