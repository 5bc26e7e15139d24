#include "apps/lapservo/live_images.h"

#include <string_view>
#include <utility>

#include "apps/lapservo/transports.h"
#include "lapservo/core/error.h"

namespace lapservo::app {
using namespace internal;
namespace {

constexpr std::string_view gst = "gst:", device = "/dev/video";

std::unique_ptr<LiveCamera> open_pipeline(const std::string& text, const std::string& option, ImageSink sink) {
#ifdef LAPSERVO_GST
  (void)option;
  return open_gst_camera(text.substr(gst.size()), std::move(sink));
#else
  (void)sink;
  throw InputError(option, "is " + text +
                               ", which this build lacks: it was built without libgstreamer1.0-dev and "
                               "libgstreamer-plugins-base1.0-dev");
#endif
}

Transport::Subscription subscribe(Transport& transport, const std::string& topic, const ImageSink& sink) {
  return topic.ends_with("/compressed") ? transport.subscribe_compressed_images(topic, sink.compressed)
                                        : transport.subscribe_images(topic, sink.image);
}

}  // namespace

Transport& Transports::get(const std::string& transport, const std::string& option) {
  auto& made = transports_[transport];
  if (!made) made = make_transport(transport, node_name_, option);
  return *made;
}

bool names_live_images(const std::string& text) {
  return names_topic(text) || text.starts_with(gst) || text.starts_with(device);
}

bool names_topic(const std::string& text) {
  return text.starts_with("ros1:") || text.starts_with("ros2:");
}

ImageInput open_images(const std::string& text, const std::string& option, const cv::Size& size, Transports& transports,
                       ImageSink sink) {
  if (names_topic(text)) {
    const Address address = address_of(text, option);
    return {subscribe(transports.get(address.transport, option), address.name, sink), nullptr};
  }
  if (text.starts_with(gst)) return {nullptr, open_pipeline(text, option, std::move(sink))};
  if (!text.starts_with(device))
    throw InputError(option, (text.empty() ? "is missing" : "is " + text) +
                                 ", expected ros2:/topic, ros1:/topic, /dev/videoN or gst:PIPELINE");
  if (size.empty()) throw InputError(option, "is " + text + ", which needs --rig: it is asked for its camera's size");
  return {nullptr, open_v4l2_camera(text, size.width, size.height, std::move(sink))};
}

LiveImages::LiveImages(const std::string& text, const std::string& option, const Camera& camera, const Clock& clock,
                       Transports& transports)
    : clock_(clock),
      receiver_(camera.width_px, camera.height_px, names_topic(text) ? StampsBy::sender : StampsBy::loop),
      input_(open_images(text, option, {camera.width_px, camera.height_px}, transports, sink())) {}

ImageSink LiveImages::sink() {
  return {[this](ImageMessage&& message) { receiver_.receive(std::move(message), clock_.now_s()); },
          [this](CompressedImageMessage&& message) { receiver_.receive(std::move(message), clock_.now_s()); }};
}

}  // namespace lapservo::app
