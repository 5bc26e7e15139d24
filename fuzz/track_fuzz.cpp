#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "fuzz/require_observation.h"
#include "fuzz/small_rig.h"
#include "lapservo/io/overlay.h"
#include "lapservo/io/tables/observation_csv.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/renderer.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/vision/tracker.h"

// All results for any changed image of a marker are finite and can be written and drawn. The first byte chooses rig and
// method, the second the image; every eight that follow paint over it, or show it to the tracker and go on.
namespace lapservo::internal::track_fuzz {
using fuzz::require;

std::vector<cv::Mat> pictures() {
  const Rig rig = fuzz::small_rig(true, false);
  Renderer renderer(rig.camera, shafts_of(rig), make_tissue(rig.camera.width_px, rig.camera.height_px, 1));
  const auto place = [&](const JointVector& q) { return placement_of(rig.instruments[0], q); };
  std::vector<cv::Mat> rendered;
  for (const double psi_rad : {0.3, 1.8, 3.2, 5.0})
    rendered.push_back(renderer.render(
        {place({-0.05, 1.5, 0.085, psi_rad}), place({0.15 + 0.02 * psi_rad, 1.6, 0.08, 2 * psi_rad})}, 7));
  return rendered;
}

// Made once: their tables of colours take longer than a frame.
struct TrackedRig {
  Rig rig;
  Tracker tracker;

  TrackedRig(bool registered, bool distorted, Method method)
      : rig(fuzz::small_rig(registered, distorted)), tracker(rig, {.method = method}) {}
};

std::vector<TrackedRig> all_rigs() {
  std::vector<TrackedRig> rigs;
  for (const bool registered : {false, true})
    for (const bool distorted : {false, true})
      for (const Method method : {Method::surface, Method::centerline})
        rigs.emplace_back(registered, distorted, method);
  return rigs;
}

class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : at_(data), end_(data + size) {}
  bool empty() const { return at_ == end_; }
  std::uint8_t next() { return empty() ? std::uint8_t{0} : *at_++; }

 private:
  const std::uint8_t* at_;
  const std::uint8_t* end_;
};

cv::Rect next_rect(Bytes& bytes, cv::Size size) {
  const int x = bytes.next() % size.width, y = bytes.next() % size.height;
  return {x, y, 1 + bytes.next() % (size.width - x), 1 + bytes.next() % (size.height - y)};
}

void paint(cv::Mat& image, std::uint8_t how, Bytes& bytes) {
  const cv::Rect rect = next_rect(bytes, image.size());
  const cv::Scalar value(bytes.next(), bytes.next(), bytes.next());
  cv::Mat part = image(rect);
  switch (how % 6) {
    case 0:
      part.setTo(value);
      return;
    case 1:
      part.convertTo(part, -1, value[0] / 64, value[1] - 128);
      return;
    case 2:
      cv::flip(part.clone(), part, how % 3 - 1);
      return;
    case 3:
      cv::blur(part.clone(), part, {1 + static_cast<int>(value[0]) % 9, 1 + static_cast<int>(value[1]) % 9});
      return;
    case 4:
      image(cv::Rect(0, 0, rect.width, rect.height)).clone().copyTo(part);
      return;
    default:
      cv::randu(part, value, cv::Scalar(255, 255, 255));
  }
}

void track(TrackedRig& tracked, const cv::Mat& image) {
  auto& [rig, tracker] = tracked;
  const auto& observations = tracker.track(image);
  require(observations.size() == rig.instruments.size(), "one observation an instrument");
  for (const Observation& observation : observations) {
    fuzz::require_sound(observation);
    const std::string row = observation_csv_row(0, 0, "0.png", observation);
    const std::string_view header = observation_csv_header;
    require(std::count(row.begin(), row.end(), ',') == std::count(header.begin(), header.end(), ','),
            "a row has the header's fields");
  }
  require(draw_overlay(image, rig, observations).size() == image.size(), "an overlay has its image's size");
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::vector<cv::Mat> base = pictures();
  static std::vector<TrackedRig> rigs = all_rigs();
  cv::theRNG().state = 1;
  Bytes bytes(data, size);
  const std::uint8_t choice = bytes.next();
  TrackedRig& tracked = rigs[choice % rigs.size()];
  tracked.tracker.reset();
  cv::Mat image = base[bytes.next() % base.size()].clone();
  int frames_left = 3;
  while (!bytes.empty() && frames_left > 1) {
    const std::uint8_t how = bytes.next();
    if (how < 32) track(tracked, image), --frames_left;
    paint(image, how, bytes);
  }
  track(tracked, image);
  return 0;
}

}  // namespace lapservo::internal::track_fuzz
