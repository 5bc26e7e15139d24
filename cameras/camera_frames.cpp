#include <cmath>
#include <utility>

#include "cameras/camera.h"
#include "lapservo/robot/steady_clock.h"

namespace lapservo::internal {
namespace {

class CameraFrames : public FrameSource {
 public:
  CameraFrames(std::unique_ptr<LiveCamera> camera, std::function<bool()> stop)
      : camera_(std::move(camera)), stop_(std::move(stop)) {}

  std::optional<Frame> next() override {
    constexpr std::chrono::milliseconds moment(50);
    constexpr double patience_s = 15;
    for (const double begin_s = clock_.now_s(); !stop_ || !stop_();) {
      const auto ended = camera_->ended();  // before the last image, which may have come since
      if (auto image = camera_->take(moment)) return frame_of(*image);
      if (ended) {
        complaint_ = *ended;
        return std::nullopt;
      }
      if (clock_.now_s() > begin_s + patience_s) {
        complaint_ = "no image came within 15 s";
        return std::nullopt;
      }
    }
    return std::nullopt;
  }
  Kind kind() const override { return Kind::live; }
  std::optional<int> frame_count() const override { return std::nullopt; }
  double frames_per_second() const override { return camera_->frames_per_second(); }
  std::string complaint() const override { return complaint_; }

 private:
  Frame frame_of(ImageMessage& image) {
    const double time_s = std::isfinite(image.stamp_s) ? image.stamp_s : clock_.now_s();
    if (index_ == 0) first_s_ = time_s;
    const cv::Mat bgr(static_cast<int>(image.height), static_cast<int>(image.width), CV_8UC3, image.data.data(),
                      image.step);
    return {bgr.clone(), index_++, time_s - first_s_, {}, {}};
  }

  std::unique_ptr<LiveCamera> camera_;
  std::function<bool()> stop_;
  SteadyClock clock_;
  std::string complaint_;
  double first_s_ = 0;
  int index_ = 0;
};

}  // namespace

std::unique_ptr<FrameSource> open_camera_or_file(const std::string& input, double folder_fps, const cv::Size& size,
                                                 std::function<bool()> stop, const VideoReading& reading) {
  if (!names_camera(input)) return open_frame_source(input, folder_fps, reading);
  return std::make_unique<CameraFrames>(open_camera(input, size), std::move(stop));
}

}  // namespace lapservo::internal
