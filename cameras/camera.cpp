#include "cameras/camera.h"

#include <cmath>
#include <filesystem>
#include <iomanip>
#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>

#include "cameras/live_source.h"

namespace lapservo::internal {
namespace {

constexpr std::string_view pipeline = "gst:", device = "/dev/video", by_name = "/dev/v4l/";

bool is_number(const std::string& text) {
  return !text.empty() && text.size() < 4 && text.find_first_not_of("0123456789") == std::string::npos;
}

class CameraFrames : public LiveSource {
 public:
  CameraFrames(std::unique_ptr<LiveCamera> camera, std::function<bool()> stop)
      : LiveSource(std::move(stop)), camera_(std::move(camera)) {}

  double frames_per_second() const override { return camera_->frames_per_second(); }

 protected:
  std::optional<StampedImage> take() override {
    auto image = camera_->take(std::chrono::milliseconds(50));
    if (image && !std::isfinite(image->time_s)) image->time_s = clock_.now_s();
    return image;
  }
  std::optional<std::string> ended() const override { return camera_->ended(); }

 private:
  std::unique_ptr<LiveCamera> camera_;
};

}  // namespace

bool names_camera(const std::string& text) {
  if (text.starts_with(pipeline) || text.starts_with(device) || text.starts_with(by_name)) return true;
  std::error_code error;
  return is_number(text) && !std::filesystem::exists(text, error);
}

std::string camera_pipeline(const std::string& camera, const cv::Size& size) {
  if (camera.starts_with(pipeline)) return camera.substr(pipeline.size());
  const std::string path = is_number(camera) ? std::string(device) + camera : camera;
  std::string sized;
  if (!size.empty()) sized = ",width=" + std::to_string(size.width) + ",height=" + std::to_string(size.height);
  std::ostringstream text;
  text << "v4l2src device=" << std::quoted(path) << " ! capsfilter caps=\"video/x-raw" << sized
       << ",framerate=[25/1,1000/1];image/jpeg" << sized << ";video/x-raw" << sized << "\" ! decodebin";
  return text.str();
}

std::unique_ptr<FrameSource> open_camera_or_file(const std::string& input, double folder_fps, const cv::Size& size,
                                                 std::function<bool()> stop, const VideoReading& reading) {
  if (!names_camera(input)) return open_frame_source(input, folder_fps, reading);
  return std::make_unique<CameraFrames>(open_camera(input, size), std::move(stop));
}

}  // namespace lapservo::internal
