#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <gst/app/gstappsink.h>
#include <gst/gst.h>
#include <gst/video/video.h>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include <opencv2/core.hpp>

#include "cameras/camera.h"
#include "lapservo/core/error.h"
#include "lapservo/io/video/yuv_picture.h"

namespace lapservo::internal {
namespace {

template <auto unref>
struct Unref {
  void operator()(auto* object) const { unref(object); }
};
template <typename T>
using Owned = std::unique_ptr<T, Unref<gst_object_unref>>;

// Errors quote whole paragraphs.
std::string one_line(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
  while (!text.empty() && (text.back() == ' ' || text.back() == '.')) text.pop_back();
  return text;
}

std::string text_of(GError* error) {
  const std::string text = error ? one_line(error->message) : "without a reason";
  g_clear_error(&error);
  return text;
}

// An element's end, by an error or the last image. Details, as the system's error, follow the place in the source.
std::string end_of(GstMessage* message) {
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_EOS) return {};
  GError* error = nullptr;
  gchar* details = nullptr;
  gst_message_parse_error(message, &error, &details);
  const std::string all = details ? details : "";
  g_free(details);
  const std::size_t line = all.find('\n');
  return std::string(GST_OBJECT_NAME(GST_MESSAGE_SRC(message))) + ": " + text_of(error) +
         (line == std::string::npos ? "" : ", " + one_line(all.substr(line + 1)));
}

// By the caps. GStreamer's elements name a site by the height of the image alone where they know none: amid the pixels
// up to 576 rows, else the left. Packed 4:2:2 has chroma on the left nevertheless, and JPEG amid the pixels.
ChromaSite site_of(const GstVideoInfo& info, bool is_jpeg) {
  const GstVideoFormat format = GST_VIDEO_INFO_FORMAT(&info);
  const bool packed = format == GST_VIDEO_FORMAT_YUY2 || format == GST_VIDEO_FORMAT_UYVY;
  const bool is_top = (info.chroma_site & GST_VIDEO_CHROMA_SITE_V_COSITED) != 0;
  if (is_jpeg) return ChromaSite::centre;
  if ((info.chroma_site & GST_VIDEO_CHROMA_SITE_H_COSITED) != 0)
    return is_top ? ChromaSite::top_left : ChromaSite::left;
  if (is_top) return ChromaSite::top;
  return packed || info.chroma_site == GST_VIDEO_CHROMA_SITE_UNKNOWN ? ChromaSite::left : ChromaSite::centre;
}

YuvColours colours_of(const GstVideoInfo& info) {
  YuvColours colours;
  colours.full_range = info.colorimetry.range == GST_VIDEO_COLOR_RANGE_0_255;
  const bool is_601 = info.colorimetry.matrix == GST_VIDEO_COLOR_MATRIX_BT601;
  const auto matrix = yuv_matrix_of(static_cast<int>(gst_video_color_matrix_to_iso(info.colorimetry.matrix)));
  colours.matrix = matrix.value_or(YuvMatrix::bt601);
  colours.chroma = site_of(info, is_601 && colours.full_range);
  colours.transfer = transfer_of_code(static_cast<int>(gst_video_transfer_function_to_iso(info.colorimetry.transfer)));
  return colours;
}

struct Layout {
  GstVideoFormat format;
  YuvPicture::Layout layout;
};
constexpr std::array layouts{Layout{GST_VIDEO_FORMAT_I420, YuvPicture::Layout::planar_420},
                             Layout{GST_VIDEO_FORMAT_Y42B, YuvPicture::Layout::planar_422},
                             Layout{GST_VIDEO_FORMAT_Y444, YuvPicture::Layout::planar_444},
                             Layout{GST_VIDEO_FORMAT_NV12, YuvPicture::Layout::nv12},
                             Layout{GST_VIDEO_FORMAT_YUY2, YuvPicture::Layout::yuyv},
                             Layout{GST_VIDEO_FORMAT_UYVY, YuvPicture::Layout::uyvy}};
constexpr const char* formats = "{BGR,I420,Y42B,Y444,NV12,YUY2,UYVY}";

// GStreamer's own conversion to RGB is off by up to 5, and repeats chroma of some formats.
bool convert(const GstVideoFrame& frame, cv::Mat& bgr) {
  const GstVideoInfo& info = frame.info;
  if (GST_VIDEO_INFO_IS_RGB(&info)) {
    cv::Mat(bgr.size(), CV_8UC3, GST_VIDEO_FRAME_PLANE_DATA(&frame, 0),
            static_cast<std::size_t>(GST_VIDEO_FRAME_PLANE_STRIDE(&frame, 0)))
        .copyTo(bgr);
    return true;
  }
  const auto found = std::ranges::find(layouts, GST_VIDEO_INFO_FORMAT(&info), &Layout::format);
  if (found == layouts.end()) return false;
  YuvPicture picture{found->layout, bgr.size()};
  for (guint i = 0; i < GST_VIDEO_FRAME_N_PLANES(&frame); ++i) {
    picture.planes[i] = static_cast<const std::uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, i));
    picture.steps[i] = GST_VIDEO_FRAME_PLANE_STRIDE(&frame, i);
  }
  picture.by_field = GST_VIDEO_FRAME_IS_INTERLACED(&frame);
  return convert_to_bgr(picture, colours_of(info), bgr);
}

void require_gstreamer() {
  GError* error = nullptr;
  if (!gst_init_check(nullptr, nullptr, &error)) throw InputError("GStreamer", "can't be used: " + text_of(error));
}

class GstCamera : public LiveCamera {
 public:
  GstCamera(const std::string& camera, const cv::Size& size, CameraSink sink)
      : camera_(camera), size_(size), sink_(std::move(sink)) {
    require_gstreamer();
    parse();
    // The clock of our stamps: the monotonic one, as everywhere.
    const Owned<GstClock> clock(gst_system_clock_obtain());
    gst_pipeline_use_clock(GST_PIPELINE(pipeline_.get()), clock.get());
    try {
      start();
    } catch (...) {
      gst_element_set_state(pipeline_.get(), GST_STATE_NULL);
      throw;
    }
  }
  ~GstCamera() override { gst_element_set_state(pipeline_.get(), GST_STATE_NULL); }

  std::optional<std::string> ended() const override { return ended_within(0); }

  std::optional<StampedImage> take(std::chrono::milliseconds patience) override {
    StampedImage image;
    const bool came = take(patience, image.time_s, [&](const cv::Size& size) {
      image.bgr.create(size, CV_8UC3);
      return image.bgr;
    });
    return came ? std::optional(std::move(image)) : std::nullopt;
  }

  double frames_per_second() const override {
    constexpr double usual = 30;
    const Owned<GstPad> pad(gst_element_get_static_pad(sink_element_.get(), "sink"));
    GstCaps* const caps = gst_pad_get_current_caps(pad.get());
    GstVideoInfo info;
    const bool announced = caps && gst_video_info_from_caps(&info, caps) && info.fps_n > 0 && info.fps_d > 0;
    if (caps) gst_caps_unref(caps);
    return announced ? static_cast<double>(info.fps_n) / info.fps_d : usual;
  }

 private:
  // Waits so long where no end is known yet.
  std::optional<std::string> ended_within(GstClockTime patience) const {
    const Owned<GstBus> bus(gst_element_get_bus(pipeline_.get()));
    const std::lock_guard lock(mutex_);
    constexpr auto last = static_cast<GstMessageType>(GST_MESSAGE_ERROR | GST_MESSAGE_EOS);
    const std::unique_ptr<GstMessage, Unref<gst_message_unref>> message(
        gst_bus_timed_pop_filtered(bus.get(), ended_ ? 0 : patience, last));
    if (message && !ended_) ended_ = end_of(message.get());
    return ended_;
  }

  GstAppSink* app_sink() const { return GST_APP_SINK(sink_element_.get()); }

  void parse() {
    GError* error = nullptr;
    const std::string whole = camera_pipeline(camera_, size_) + " ! videoconvert ! video/x-raw,format=" + formats +
                              " ! appsink name=lapservo_sink max-buffers=2";
    pipeline_.reset(gst_parse_launch_full(whole.c_str(), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error));
    if (error && g_error_matches(error, GST_PARSE_ERROR, GST_PARSE_ERROR_NO_SUCH_ELEMENT))
      refuse(text_of(error), "one of installed plugins, as gstreamer1.0-plugins-base and gstreamer1.0-plugins-good");
    if (!pipeline_ || error) refuse(text_of(error), expectation());
    if (!GST_IS_PIPELINE(pipeline_.get())) refuse("it is no pipeline", expectation());
    sink_element_.reset(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "lapservo_sink"));
    if (!sink_) return;
    GstAppSinkCallbacks callbacks{};
    callbacks.new_sample = [](GstAppSink*, gpointer camera) {
      auto& self = *static_cast<GstCamera*>(camera);
      ImageMessage message;
      message.encoding = "bgr8";
      const bool came = self.take(std::chrono::milliseconds(0), message.stamp_s, [&](const cv::Size& size) {
        message.width = static_cast<std::uint32_t>(size.width);
        message.height = static_cast<std::uint32_t>(size.height);
        message.step = 3 * message.width;
        message.data.resize(std::size_t{message.step} * message.height);
        return cv::Mat(size, CV_8UC3, message.data.data());
      });
      if (came) self.sink_(std::move(message));
      return GST_FLOW_OK;
    };
    gst_app_sink_set_callbacks(app_sink(), &callbacks, this, nullptr);
  }

  // Takes live images as they come; other sources at their own speed, and whole.
  void start() {
    const bool live = change_to(GST_STATE_PAUSED) == GST_STATE_CHANGE_NO_PREROLL;
    g_object_set(sink_element_.get(), "sync", !live, "drop", live, nullptr);
    change_to(GST_STATE_PLAYING);
  }
  // Until the first image is there; but what is live gives none while it is paused.
  GstStateChangeReturn change_to(GstState state) const {
    constexpr GstClockTime moment = 50 * GST_MSECOND, patience = 10 * GST_SECOND;
    GstStateChangeReturn changed = gst_element_set_state(pipeline_.get(), state);
    for (GstClockTime waited = 0; changed == GST_STATE_CHANGE_ASYNC && waited < patience; waited += moment) {
      changed = gst_element_get_state(pipeline_.get(), nullptr, nullptr, moment);
      if (changed == GST_STATE_CHANGE_ASYNC && !ended().value_or("").empty()) break;
    }
    if (changed == GST_STATE_CHANGE_FAILURE || changed == GST_STATE_CHANGE_ASYNC) {
      // An element that has failed may be about to say why in its own thread, which waits for a busy computer alone.
      const bool late = changed == GST_STATE_CHANGE_ASYNC;
      const std::string why = ended_within(late ? 0 : GST_SECOND).value_or("");
      refuse(!why.empty() ? why : late ? "none came within 10 s" : "it does not start", expectation());
    }
    return changed;
  }

  std::string expectation() const {
    if (camera_.starts_with("gst:")) return "a pipeline without a sink: videotestsrc";
    const std::string size = std::to_string(size_.width) + "x" + std::to_string(size_.height) + " as in the rig";
    return "a camera that is plugged in, that this user may open (group video) and no other program uses" +
           (size_.empty() ? "" : ", and that gives " + size);
  }
  [[noreturn]] void refuse(const std::string& why, const std::string& expected) const {
    throw InputError(camera_, "gives no images (" + why + "), expected " + expected);
  }

  // The next image, in 8-bit BGR into what `place` returns for its size; false when none comes.
  bool take(std::chrono::milliseconds patience, double& stamp_s,
            const std::function<cv::Mat(const cv::Size&)>& place) const {
    const std::unique_ptr<GstSample, Unref<gst_sample_unref>> sample(
        gst_app_sink_try_pull_sample(app_sink(), std::chrono::nanoseconds(patience).count()));
    GstVideoInfo info;
    GstVideoFrame frame;
    if (!sample || !gst_video_info_from_caps(&info, gst_sample_get_caps(sample.get())) ||
        !gst_video_frame_map(&frame, &info, gst_sample_get_buffer(sample.get()), GST_MAP_READ))
      return false;
    stamp_s = stamp_of(*sample);
    cv::Mat bgr = place({GST_VIDEO_FRAME_WIDTH(&frame), GST_VIDEO_FRAME_HEIGHT(&frame)});
    const bool converted = convert(frame, bgr);
    gst_video_frame_unmap(&frame);
    return converted;
  }
  double stamp_of(GstSample& sample) const {
    const GstSegment* const segment = gst_sample_get_segment(&sample);
    const GstClockTime at = GST_BUFFER_PTS(gst_sample_get_buffer(&sample));
    const GstClockTime running = segment && GST_CLOCK_TIME_IS_VALID(at)
                                     ? gst_segment_to_running_time(segment, GST_FORMAT_TIME, at)
                                     : GST_CLOCK_TIME_NONE;
    const GstClockTime base = gst_element_get_base_time(pipeline_.get());
    if (!GST_CLOCK_TIME_IS_VALID(running) || !GST_CLOCK_TIME_IS_VALID(base))
      return std::numeric_limits<double>::quiet_NaN();
    return 1e-9 * static_cast<double>(running + base);
  }

  std::string camera_;
  cv::Size size_;
  CameraSink sink_;
  Owned<GstElement> pipeline_, sink_element_;
  mutable std::mutex mutex_;
  mutable std::optional<std::string> ended_;
};

}  // namespace

std::unique_ptr<LiveCamera> open_camera(const std::string& camera, const cv::Size& size, CameraSink sink) {
  return std::make_unique<GstCamera>(camera, size, std::move(sink));
}

}  // namespace lapservo::internal
