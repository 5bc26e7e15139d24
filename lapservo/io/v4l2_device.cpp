#include "lapservo/io/v4l2_device.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fcntl.h>
#include <limits>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>
#include <utility>
#include <vector>

#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {

// In the order in which they are preferred.
constexpr std::array<std::uint32_t, 7> known{V4L2_PIX_FMT_BGR24, V4L2_PIX_FMT_RGB24, V4L2_PIX_FMT_YUYV,
                                             V4L2_PIX_FMT_UYVY,  V4L2_PIX_FMT_NV12,  V4L2_PIX_FMT_MJPEG,
                                             V4L2_PIX_FMT_JPEG};

auto rank(std::uint32_t pixel_format) {
  return std::find(known.begin(), known.end(), pixel_format);
}

constexpr std::uint32_t buffer_count = 4;

class OpenDevice {
 public:
  explicit OpenDevice(const std::string& path)
      : path_(path), file_(::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC)) {
    if (file_ < 0) refuse(std::string("can't be opened (") + std::strerror(errno) + "), expected a camera");
  }
  ~OpenDevice() { ::close(file_); }
  OpenDevice(const OpenDevice&) = delete;
  OpenDevice& operator=(const OpenDevice&) = delete;

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
  Mapped(const OpenDevice& device, std::uint32_t index) {
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

void require_capture(const OpenDevice& device) {
  v4l2_capability is{};
  if (!device.call(VIDIOC_QUERYCAP, &is)) device.refuse("is no Video4Linux device, expected a camera");
  const std::uint32_t can = is.capabilities & V4L2_CAP_DEVICE_CAPS ? is.device_caps : is.capabilities;
  if (!(can & V4L2_CAP_VIDEO_CAPTURE) || !(can & V4L2_CAP_STREAMING))
    device.refuse("streams no video, expected a camera (a camera's other devices carry its settings or sound)");
}

// At that size. Drivers that don't tell leave it unknown.
double max_frames_per_second(const OpenDevice& device, std::uint32_t pixel_format, std::uint32_t width,
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
std::vector<V4l2Offer> offers_of(const OpenDevice& device, std::uint32_t width, std::uint32_t height,
                                 std::string& heard) {
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

cv::Size present_size(const OpenDevice& device) {
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  device.need(VIDIOC_G_FMT, &format, "VIDIOC_G_FMT");
  return {static_cast<int>(format.fmt.pix.width), static_cast<int>(format.fmt.pix.height)};
}

// As fast as it can: a wish. What the driver makes of it; 0 where it does not tell.
double set_frame_rate(const OpenDevice& device, double wanted) {
  constexpr std::uint32_t scale = 1000;
  v4l2_streamparm parameters{};
  parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  v4l2_fract& period = parameters.parm.capture.timeperframe;
  period = {scale, static_cast<std::uint32_t>(wanted * scale)};
  const bool told = device.call(wanted > 0 ? VIDIOC_S_PARM : VIDIOC_G_PARM, &parameters);
  const double rate = told && period.numerator > 0 ? 1.0 * period.denominator / period.numerator : 0;
  return rate > 0.1 && rate < 10000 ? rate : 0;
}

V4l2Layout negotiate(const OpenDevice& device, std::optional<cv::Size> wanted) {
  const cv::Size chosen = wanted ? *wanted : present_size(device);
  const auto width = static_cast<std::uint32_t>(chosen.width), height = static_cast<std::uint32_t>(chosen.height);
  const std::string whose = wanted ? " as in the rig" : " as it is set to";
  std::string heard;
  const auto offer = best_offer(offers_of(device, width, height, heard));
  const std::string size = std::to_string(width) + "x" + std::to_string(height);
  if (!offer)
    device.refuse("offers " + (heard.empty() ? "nothing" : heard) + ", expected " + size + whose +
                  ", in BGR3, RGB3, YUYV, UYVY, NV12 or MJPG");
  v4l2_format format = format_of(offer->pixel_format, width, height);
  device.need(VIDIOC_S_FMT, &format, "VIDIOC_S_FMT");
  const auto& got = format.fmt.pix;
  if (got.pixelformat != offer->pixel_format || got.width != width || got.height != height)
    device.refuse("gives " + four_letters(got.pixelformat) + " " + std::to_string(got.width) + "x" +
                  std::to_string(got.height) + ", expected " + size + whose);
  return {got.pixelformat, got.width, got.height, got.bytesperline,
          set_frame_rate(device, offer->max_frames_per_second)};
}

double stamp_of(const v4l2_buffer& buffer) {
  if ((buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC)
    return std::numeric_limits<double>::quiet_NaN();
  return static_cast<double>(buffer.timestamp.tv_sec) + 1e-6 * static_cast<double>(buffer.timestamp.tv_usec);
}

}  // namespace

std::optional<V4l2Offer> best_offer(const std::vector<V4l2Offer>& offers) {
  std::optional<V4l2Offer> best;
  const auto is_better = [&](const V4l2Offer& offer) {
    constexpr double same = 0.5;  // 29.97 is 30
    const double faster = offer.max_frames_per_second - best->max_frames_per_second;
    if (std::abs(faster) > same) return faster > 0;
    return rank(offer.pixel_format) < rank(best->pixel_format);
  };
  for (const V4l2Offer& offer : offers)
    if (rank(offer.pixel_format) != known.end() && (!best || is_better(offer))) best = offer;
  return best;
}

std::string four_letters(std::uint32_t pixel_format) {
  std::string letters;
  for (int shift = 0; shift < 32; shift += 8) {
    const char letter = static_cast<char>(pixel_format >> shift & 0x7f);
    letters += letter > ' ' && letter <= '~' ? letter : '?';
  }
  return letters;
}

class V4l2Device::State {
 public:
  State(const std::string& path, std::optional<cv::Size> size) : device_(path) {
    require_capture(device_);
    layout_ = negotiate(device_, size);
    v4l2_requestbuffers request{};
    request.count = buffer_count;
    request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    request.memory = V4L2_MEMORY_MMAP;
    device_.need(VIDIOC_REQBUFS, &request, "VIDIOC_REQBUFS");
    for (std::uint32_t i = 0; i < request.count; ++i) buffers_.emplace_back(device_, i);
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    device_.need(VIDIOC_STREAMON, &type, "VIDIOC_STREAMON");
  }
  ~State() {
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    device_.call(VIDIOC_STREAMOFF, &type);
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  const V4l2Layout& layout() const { return layout_; }

  bool wait(std::chrono::milliseconds patience) const {
    pollfd ready{device_.file(), POLLIN, 0};
    return ::poll(&ready, 1, static_cast<int>(patience.count())) > 0;
  }

  std::string take(const Taker& taker) {
    v4l2_buffer buffer{};
    buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    buffer.memory = V4L2_MEMORY_MMAP;
    if (!device_.call(VIDIOC_DQBUF, &buffer)) return errno == EAGAIN ? "" : std::strerror(errno);
    const bool damaged = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0;
    if (buffer.index < buffers_.size())
      taker(buffers_[buffer.index].first(damaged ? 0 : buffer.bytesused), stamp_of(buffer));
    return device_.call(VIDIOC_QBUF, &buffer) ? "" : std::strerror(errno);
  }

 private:
  OpenDevice device_;
  V4l2Layout layout_;
  std::vector<Mapped> buffers_;
};

V4l2Device::V4l2Device(const std::string& path, std::optional<cv::Size> size)
    : state_(std::make_unique<State>(path, size)) {}
V4l2Device::~V4l2Device() = default;

const V4l2Layout& V4l2Device::layout() const {
  return state_->layout();
}
bool V4l2Device::wait(std::chrono::milliseconds patience) const {
  return state_->wait(patience);
}
std::string V4l2Device::take(const Taker& taker) {
  return state_->take(taker);
}

}  // namespace lapservo::internal
