#include <cstdint>
#include <gst/app/gstappsink.h>
#include <gst/gst.h>
#include <gst/video/video.h>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "cameras/camera.h"
#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {

constexpr GstClockTime patience = 10 * GST_SECOND;

struct Unref {
  void operator()(void* object) const { gst_object_unref(object); }
};
template <typename T>
using Owned = std::unique_ptr<T, Unref>;
struct UnrefSample {
  void operator()(GstSample* sample) const { gst_sample_unref(sample); }
};
struct UnrefMessage {
  void operator()(GstMessage* message) const { gst_message_unref(message); }
};

// Errors quote whole paragraphs.
std::string one_line(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
  while (!text.empty() && (text.back() == ' ' || text.back() == '.')) text.pop_back();
  return text;
}

std::string text_of(GError* error) {
  const std::string text = error ? one_line(error->message) : "for no reason that is told";
  g_clear_error(&error);
  return text;
}

// What an element says of its end, an error or the last image.
std::string end_of(GstMessage* message) {
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_EOS) return {};
  GError* error = nullptr;
  gst_message_parse_error(message, &error, nullptr);
  return std::string(GST_OBJECT_NAME(GST_MESSAGE_SRC(message))) + ": " + text_of(error);
}

void require_gstreamer() {
  GError* error = nullptr;
  if (!gst_init_check(nullptr, nullptr, &error)) throw InputError("GStreamer", "can't be used: " + text_of(error));
}

class GstCamera : public LiveCamera {
 public:
  GstCamera(const std::string& text, ImageSink sink) : text_(text), sink_(std::move(sink)) {
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
  GstCamera(const GstCamera&) = delete;
  GstCamera& operator=(const GstCamera&) = delete;

  std::optional<std::string> ended() const override {
    const Owned<GstBus> bus(gst_element_get_bus(pipeline_.get()));
    const std::lock_guard lock(mutex_);
    constexpr auto last = static_cast<GstMessageType>(GST_MESSAGE_ERROR | GST_MESSAGE_EOS);
    const std::unique_ptr<GstMessage, UnrefMessage> message(gst_bus_pop_filtered(bus.get(), last));
    if (message && !ended_) ended_ = end_of(message.get());
    return ended_;
  }

 private:
  void parse() {
    GError* error = nullptr;
    const std::string whole =
        text_ + " ! videoconvert ! video/x-raw,format=BGR ! appsink name=lapservo_sink max-buffers=2 drop=true";
    pipeline_.reset(gst_parse_launch_full(whole.c_str(), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error));
    if (!pipeline_ || error) refuse(text_of(error));
    g_clear_error(&error);
    if (!GST_IS_PIPELINE(pipeline_.get())) refuse("it is no pipeline");
    sink_element_.reset(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "lapservo_sink"));
    GstAppSinkCallbacks callbacks{};
    callbacks.new_sample = [](GstAppSink* from, gpointer camera) {
      static_cast<GstCamera*>(camera)->take(from);
      return GST_FLOW_OK;
    };
    gst_app_sink_set_callbacks(GST_APP_SINK(sink_element_.get()), &callbacks, this, nullptr);
  }
  void start() {
    GstStateChangeReturn paused = gst_element_set_state(pipeline_.get(), GST_STATE_PAUSED);
    if (paused == GST_STATE_CHANGE_ASYNC) paused = gst_element_get_state(pipeline_.get(), nullptr, nullptr, patience);
    if (paused == GST_STATE_CHANGE_FAILURE || paused == GST_STATE_CHANGE_ASYNC) {
      refuse(ended().value_or("no image came within 10 s"));
    }
    // What is live is taken as it comes; the rest at its own speed.
    g_object_set(sink_element_.get(), "sync", paused != GST_STATE_CHANGE_NO_PREROLL, nullptr);
    if (gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING) == GST_STATE_CHANGE_FAILURE)
      refuse(ended().value_or("it does not start"));
  }
  [[noreturn]] void refuse(const std::string& why) const {
    throw InputError("gst:" + text_, "can't be played (" + why + "), expected a pipeline without a sink: videotestsrc");
  }

  void take(GstAppSink* from) {
    const std::unique_ptr<GstSample, UnrefSample> sample(gst_app_sink_pull_sample(from));
    GstVideoInfo info;
    GstVideoFrame frame;
    if (!sample || !gst_video_info_from_caps(&info, gst_sample_get_caps(sample.get())) ||
        !gst_video_frame_map(&frame, &info, gst_sample_get_buffer(sample.get()), GST_MAP_READ))
      return;
    ImageMessage message{stamp_of(*sample), {}, {}, {}, "bgr8", false, {}};
    message.width = static_cast<std::uint32_t>(GST_VIDEO_FRAME_WIDTH(&frame));
    message.height = static_cast<std::uint32_t>(GST_VIDEO_FRAME_HEIGHT(&frame));
    message.step = static_cast<std::uint32_t>(GST_VIDEO_FRAME_PLANE_STRIDE(&frame, 0));
    const auto* const pixels = static_cast<const std::uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, 0));
    const std::size_t last_row = std::size_t{3} * message.width;
    if (message.height > 0)
      message.data.assign(pixels, pixels + std::size_t{message.step} * (message.height - 1) + last_row);
    gst_video_frame_unmap(&frame);
    sink_.image(std::move(message));
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

  std::string text_;
  ImageSink sink_;
  Owned<GstElement> pipeline_, sink_element_;
  mutable std::mutex mutex_;
  mutable std::optional<std::string> ended_;
};

}  // namespace

std::unique_ptr<LiveCamera> open_gst_camera(const std::string& pipeline, ImageSink sink) {
  return std::make_unique<GstCamera>(pipeline, std::move(sink));
}

}  // namespace lapservo::internal
