#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <limits>
#include <linux/videodev2.h>
#include <mutex>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <thread>
#include <unistd.h>
#include <utility>

#include "cameras/camera.h"
#include "cameras/v4l2_format.h"
#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {

constexpr std::uint32_t buffer_count = 4;

class Device {
 public:
  explicit Device(const std::string& path) : path_(path), file_(::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC)) {
    if (file_ < 0) refuse(std::string("can't be opened (") + std::strerror(errno) + "), expected a camera");
  }
  ~Device() { ::close(file_); }
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  bool call(unsigned long request, void* argument) const {
    int result = 0;
    do result = ::ioctl(file_, request, argument);
    while (result < 0 && errno == EINTR);
    return result == 0;
  }
  void need(unsigned long request, void* argument, const char* what) const {
    if (!call(request, argument)) refuse(std::string(what) + " is refused (" + std::strerror(errno) + ")");
  }
  [[noreturn]] void refuse(const std::string& why) const { throw InputError(path_, why); }
  int file() const { return file_; }

 private:
  std::string path_;
  int file_;
};

// A buffer of the driver's, in our memory.
class Mapped {
 public:
  Mapped(const Device& device, std::uint32_t index) {
    v4l2_buffer buffer{};
    buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = index;
    device.need(VIDIOC_QUERYBUF, &buffer, "VIDIOC_QUERYBUF");
    size_ = buffer.length;
    at_ = ::mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_SHARED, device.file(), buffer.m.offset);
    if (at_ == MAP_FAILED) device.refuse(std::string("can't be mapped (") + std::strerror(errno) + ")");
    device.need(VIDIOC_QBUF, &buffer, "VIDIOC_QBUF");
  }
  ~Mapped() {
    if (at_) ::munmap(at_, size_);
  }
  Mapped(Mapped&& other) noexcept : at_(std::exchange(other.at_, nullptr)), size_(other.size_) {}
  Mapped& operator=(Mapped&&) = delete;

  std::span<const std::uint8_t> first(std::size_t count) const {
    return {static_cast<const std::uint8_t*>(at_), std::min(count, size_)};
  }

 private:
  void* at_ = nullptr;
  std::size_t size_ = 0;
};

void require_capture(const Device& device) {
  v4l2_capability is{};
  if (!device.call(VIDIOC_QUERYCAP, &is)) device.refuse("is no Video4Linux device, expected a camera");
  const std::uint32_t can = is.capabilities & V4L2_CAP_DEVICE_CAPS ? is.device_caps : is.capabilities;
  if (!(can & V4L2_CAP_VIDEO_CAPTURE) || !(can & V4L2_CAP_STREAMING))
    device.refuse("streams no video, expected a camera (a camera's other devices carry its settings or sound)");
}

// At that size. Drivers that don't tell leave it unknown.
double max_frames_per_second(const Device& device, std::uint32_t pixel_format, std::uint32_t width,
                             std::uint32_t height) {
  double fastest = 0;
  v4l2_frmivalenum interval{};
  interval.pixel_format = pixel_format;
  interval.width = width;
  interval.height = height;
  for (; device.call(VIDIOC_ENUM_FRAMEINTERVALS, &interval); ++interval.index) {
    const bool discrete = interval.type == V4L2_FRMIVAL_TYPE_DISCRETE;
    const v4l2_fract shortest = discrete ? interval.discrete : interval.stepwise.min;
    if (shortest.numerator > 0) fastest = std::max(fastest, 1.0 * shortest.denominator / shortest.numerator);
    if (!discrete) break;
  }
  return fastest;
}

v4l2_format format_of(std::uint32_t pixel_format, std::uint32_t width, std::uint32_t height) {
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  format.fmt.pix.pixelformat = pixel_format;
  format.fmt.pix.width = width;
  format.fmt.pix.height = height;
  format.fmt.pix.field = V4L2_FIELD_NONE;
  return format;
}

// Drivers answer a format that they don't have with the nearest one.
std::vector<V4l2Offer> offers_of(const Device& device, std::uint32_t width, std::uint32_t height, std::string& heard) {
  std::vector<V4l2Offer> offers;
  v4l2_fmtdesc described{};
  described.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  for (; device.call(VIDIOC_ENUM_FMT, &described); ++described.index) {
    v4l2_format format = format_of(described.pixelformat, width, height);
    if (!device.call(VIDIOC_TRY_FMT, &format)) continue;
    const auto& got = format.fmt.pix;
    heard += (heard.empty() ? "" : ", ") + four_letters(got.pixelformat) + " " + std::to_string(got.width) + "x" +
             std::to_string(got.height);
    if (got.pixelformat == described.pixelformat && got.width == width && got.height == height)
      offers.push_back({got.pixelformat, max_frames_per_second(device, got.pixelformat, width, height)});
  }
  return offers;
}

V4l2Layout negotiate(const Device& device, std::uint32_t width, std::uint32_t height) {
  std::string heard;
  const auto offer = best_offer(offers_of(device, width, height, heard));
  const std::string size = std::to_string(width) + "x" + std::to_string(height);
  if (!offer)
    device.refuse("offers " + (heard.empty() ? "nothing" : heard) + ", expected " + size +
                  " as in the rig, in BGR3, RGB3, YUYV, UYVY, NV12 or MJPG");
  v4l2_format format = format_of(offer->pixel_format, width, height);
  device.need(VIDIOC_S_FMT, &format, "VIDIOC_S_FMT");
  const auto& got = format.fmt.pix;
  if (got.pixelformat != offer->pixel_format || got.width != width || got.height != height)
    device.refuse("gives " + four_letters(got.pixelformat) + " " + std::to_string(got.width) + "x" +
                  std::to_string(got.height) + ", expected " + size + " as in the rig");
  if (offer->max_frames_per_second > 0) {
    v4l2_streamparm parameters{};
    parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    constexpr std::uint32_t scale = 1000;
    parameters.parm.capture.timeperframe = {scale, static_cast<std::uint32_t>(offer->max_frames_per_second * scale)};
    device.call(VIDIOC_S_PARM, &parameters);  // a wish: what comes is counted by its stamps
  }
  return {got.pixelformat, got.width, got.height, got.bytesperline};
}

double stamp_of(const v4l2_buffer& buffer) {
  if ((buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC)
    return std::numeric_limits<double>::quiet_NaN();
  return static_cast<double>(buffer.timestamp.tv_sec) + 1e-6 * static_cast<double>(buffer.timestamp.tv_usec);
}

class V4l2Camera : public LiveCamera {
 public:
  V4l2Camera(const std::string& path, std::uint32_t width, std::uint32_t height, ImageSink sink)
      : device_(path), sink_(std::move(sink)) {
    require_capture(device_);
    layout_ = negotiate(device_, width, height);
    v4l2_requestbuffers request{};
    request.count = buffer_count;
    request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    request.memory = V4L2_MEMORY_MMAP;
    device_.need(VIDIOC_REQBUFS, &request, "VIDIOC_REQBUFS");
    for (std::uint32_t i = 0; i < request.count; ++i) buffers_.emplace_back(device_, i);
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    device_.need(VIDIOC_STREAMON, &type, "VIDIOC_STREAMON");
    thread_ = std::thread([this] { work(); });
  }
  ~V4l2Camera() override {
    stop_ = true;
    thread_.join();
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    device_.call(VIDIOC_STREAMOFF, &type);
  }
  V4l2Camera(const V4l2Camera&) = delete;
  V4l2Camera& operator=(const V4l2Camera&) = delete;

  std::optional<std::string> ended() const override {
    const std::lock_guard lock(mutex_);
    return ended_;
  }

 private:
  void work() {
    constexpr int moment_ms = 100;
    while (!stop_) {
      pollfd ready{device_.file(), POLLIN, 0};
      if (::poll(&ready, 1, moment_ms) > 0 && !take()) return;
    }
  }
  // Whether more may come.
  bool take() {
    v4l2_buffer buffer{};
    buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    buffer.memory = V4L2_MEMORY_MMAP;
    if (!device_.call(VIDIOC_DQBUF, &buffer)) return errno == EAGAIN || end(std::strerror(errno));
    if (buffer.index < buffers_.size()) pass_on(buffer);
    return device_.call(VIDIOC_QBUF, &buffer) || end(std::strerror(errno));
  }
  // Damaged ones too, without their bytes: they are counted as unreadable.
  void pass_on(const v4l2_buffer& buffer) {
    const bool damaged = buffer.flags & V4L2_BUF_FLAG_ERROR;
    auto message =
        v4l2_message(layout_, buffers_[buffer.index].first(damaged ? 0 : buffer.bytesused), stamp_of(buffer));
    if (auto* const image = std::get_if<ImageMessage>(&message)) {
      sink_.image(std::move(*image));
    } else {
      sink_.compressed(std::move(std::get<CompressedImageMessage>(message)));
    }
  }
  bool end(const std::string& why) {
    const std::lock_guard lock(mutex_);
    ended_ = "gives no more images (" + why + ")";
    return false;
  }

  Device device_;
  ImageSink sink_;
  V4l2Layout layout_;
  std::vector<Mapped> buffers_;
  std::atomic<bool> stop_ = false;
  mutable std::mutex mutex_;
  std::optional<std::string> ended_;
  std::thread thread_;
};

}  // namespace

std::unique_ptr<LiveCamera> open_v4l2_camera(const std::string& device, int width_px, int height_px, ImageSink sink) {
  return std::make_unique<V4l2Camera>(device, static_cast<std::uint32_t>(width_px),
                                      static_cast<std::uint32_t>(height_px), std::move(sink));
}

}  // namespace lapservo::internal
