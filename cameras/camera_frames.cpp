#include <cmath>
#include <utility>

#include "cameras/camera.h"
#include "cameras/live_source.h"

namespace lapservo::internal {
namespace {

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

std::unique_ptr<FrameSource> open_camera_or_file(const std::string& input, double folder_fps, const cv::Size& size,
                                                 std::function<bool()> stop, const VideoReading& reading) {
  if (!names_camera(input)) return open_frame_source(input, folder_fps, reading);
  return std::make_unique<CameraFrames>(open_camera(input, size), std::move(stop));
}

}  // namespace lapservo::internal
