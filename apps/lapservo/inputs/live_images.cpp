#include "apps/lapservo/inputs/live_images.h"

#include <utility>

#include "apps/lapservo/inputs/frame_input.h"
#include "apps/lapservo/inputs/transports.h"
#include "lapservo/core/error.h"
#include "lapservo/crtk/crtk_robot.h"

namespace lapservo::app {
using namespace internal;
namespace {

Transport::Subscription subscribe(Transport& transport, const std::string& topic, const ImageSink& sink) {
  return topic.ends_with("/compressed") ? transport.subscribe<CompressedImageMessage>(topic, sink.compressed)
                                        : transport.subscribe<ImageMessage>(topic, sink.image);
}

}  // namespace

Transport& Transports::get(const std::string& transport, const std::string& option) {
  auto& made = transports_[transport];
  if (!made) made = make_transport(transport, node_name_, option);
  return *made;
}

std::string Transports::unpublished(const std::string& text, const std::string& option, const std::string& of_arm) {
  const Address address = address_of(text, option);
  const std::string name = address.name.starts_with('/') ? address.name : "/" + address.name;
  const std::string topic = of_arm.empty() ? name : topic_of(name, of_arm);
  const auto published = get(address.transport, option).published();
  if (published.contains(topic)) return {};
  std::string others;
  for (const auto& [other, type] : published) others += (others.empty() ? "" : ", ") + other + " (" + type + ")";
  return "nobody publishes " + topic + "; " +
         (others.empty() ? "there are no topics" : "topics that are there: " + others);
}

bool names_topic(const std::string& text) {
  return text.starts_with("ros1:") || text.starts_with("ros2:");
}

std::string recorded_topic(const std::string& camera) {
  return names_topic(camera) ? address_of(camera, "--camera").name : "/camera/image_raw";
}

ImageInput open_images(const std::string& text, const std::string& option, const cv::Size& size, Transports& transports,
                       ImageSink sink) {
  if (names_topic(text)) {
    const Address address = address_of(text, option);
    return {subscribe(transports.get(address.transport, option), address.name, sink), nullptr};
  }
  if (!names_camera(text))
    throw InputError(option, (text.empty() ? "is missing" : "is " + text) +
                                 ", expected ros2:/topic, ros1:/topic, /dev/videoN or gst:PIPELINE");
  return {nullptr, open_camera(text, size, std::move(sink.image))};
}

LiveImages::LiveImages(const std::string& text, const std::string& option, const Camera& camera, const Clock& clock,
                       Transports& transports)
    : clock_(clock),
      receiver_(camera.width_px, camera.height_px, names_topic(text) ? StampsBy::sender : StampsBy::loop),
      input_(open_images(
          text, option, {camera.width_px, camera.height_px}, transports,
          {[this](ImageMessage&& image) { receiver_.receive(std::move(image), clock_.now_s()); },
           [this](CompressedImageMessage&& image) { receiver_.receive(std::move(image), clock_.now_s()); }})) {
  if (names_topic(text)) say_if_undistorted(text, &camera);
}

}  // namespace lapservo::app
