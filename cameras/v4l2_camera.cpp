#include <atomic>
#include <mutex>
#include <thread>
#include <utility>

#include "cameras/camera.h"
#include "cameras/v4l2_format.h"

namespace lapservo::internal {
namespace {

class V4l2Camera : public LiveCamera {
 public:
  V4l2Camera(const std::string& path, const cv::Size& size, ImageSink sink)
      : device_(path, size), sink_(std::move(sink)), thread_([this] { work(); }) {}
  ~V4l2Camera() override {
    stop_ = true;
    thread_.join();
  }
  V4l2Camera(const V4l2Camera&) = delete;
  V4l2Camera& operator=(const V4l2Camera&) = delete;

  std::optional<std::string> ended() const override {
    const std::lock_guard lock(mutex_);
    return ended_;
  }

 private:
  void work() {
    constexpr std::chrono::milliseconds moment(100);
    while (!stop_ && !ended()) {
      if (!device_.wait(moment)) continue;
      const std::string why = device_.take([this](auto bytes, double stamp_s) { pass_on(bytes, stamp_s); });
      if (!why.empty()) end(why);
    }
  }
  // Damaged ones too, without their bytes: they are counted as unreadable.
  void pass_on(std::span<const std::uint8_t> bytes, double stamp_s) {
    auto message = v4l2_message(device_.layout(), bytes, stamp_s);
    if (auto* const image = std::get_if<ImageMessage>(&message)) {
      sink_.image(std::move(*image));
    } else {
      sink_.compressed(std::move(std::get<CompressedImageMessage>(message)));
    }
  }
  void end(const std::string& why) {
    const std::lock_guard lock(mutex_);
    ended_ = "gives no more images (" + why + ")";
  }

  V4l2Device device_;
  ImageSink sink_;
  std::atomic<bool> stop_ = false;
  mutable std::mutex mutex_;
  std::optional<std::string> ended_;
  std::thread thread_;  // last: uses all of the above
};

}  // namespace

std::unique_ptr<LiveCamera> open_v4l2_camera(const std::string& device, int width_px, int height_px, ImageSink sink) {
  return std::make_unique<V4l2Camera>(device, cv::Size(width_px, height_px), std::move(sink));
}

}  // namespace lapservo::internal
