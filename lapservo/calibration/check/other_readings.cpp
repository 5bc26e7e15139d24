#include "lapservo/calibration/check/other_readings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/marker/band_shares.h"
#include "lapservo/marker/decoder.h"
#include "lapservo/marker/marker.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal {
namespace {

bool any_ok(const std::vector<Observation>& observations) {
  return std::ranges::count(observations, Status::ok, &Observation::status) > 0;
}

// Ends as soon as it is decided.
template <typename Wanted>
bool most(const std::vector<cv::Mat>& frames, Wanted wanted) {
  std::size_t with = 0, without = 0;
  for (const cv::Mat& frame : frames) {
    ++(wanted(frame) ? with : without);
    if (2 * with > frames.size()) return true;
    if (2 * without >= frames.size()) return false;
  }
  return false;
}

class OtherReadings {
 public:
  OtherReadings(const std::vector<cv::Mat>& frames, const Rig& rig, bool deinterlaced)
      : frames_(frames), rig_(rig), deinterlaced_(deinterlaced) {}

  std::string first() const {
    for (const auto& reading : {&OtherReadings::other_images, &OtherReadings::other_hues,
                                &OtherReadings::other_diameter, &OtherReadings::other_camera})
      if (std::string found = (this->*reading)(); !found.empty()) return found;
    return "";
  }

 private:
  template <typename Change>
  bool found_in_images(Change change) const {
    Tracker tracker(rig_, {.single = true, .deinterlace = deinterlaced_});
    return most(frames_, [&](const cv::Mat& frame) {
      cv::Mat changed;
      change(frame, changed);
      return any_ok(tracker.track(changed));
    });
  }

  // Without a registration, which goes by what the rig has now.
  template <typename Change>
  bool found_with_rig(Change change) const {
    Rig rig = rig_;
    change(rig);
    for (Instrument& instrument : rig.instruments) instrument.camera_from_rcm.reset();
    for (const Instrument& instrument : rig.instruments)
      if (marker_problem(instrument.marker)) return false;
    Tracker tracker(rig, {.single = true, .deinterlace = deinterlaced_});
    return most(frames_, [&](const cv::Mat& frame) { return any_ok(tracker.track(frame)); });
  }

  std::string other_images() const {
    if (found_in_images([](const cv::Mat& from, cv::Mat& to) { cv::cvtColor(from, to, cv::COLOR_BGR2RGB); }))
      return "the instrument is found when red and blue are exchanged: the source writes RGB where BGR is expected (in "
             "Python cv2.cvtColor(image, cv2.COLOR_RGB2BGR))";
    if (found_in_images([](const cv::Mat& from, cv::Mat& to) { cv::flip(from, to, 1); }))
      return "the instrument is found when the image is mirrored: switch the camera's or the recorder's mirroring off; "
             "where nothing mirrors, the print is mirrored: print it anew, and wrap it with its ink outside";
    return "";
  }

  std::string other_hues() const {
    for (const Instrument& instrument : rig_.instruments) {
      std::array<std::size_t, 3> order{0, 1, 2};
      while (std::next_permutation(order.begin(), order.end())) {
        auto hues_deg = instrument.marker.hues_deg;
        for (std::size_t i = 0; i < hues_deg.size(); ++i) hues_deg[i] = instrument.marker.hues_deg[order[i]];
        if (found_with_rig(
                [&](Rig& rig) { rig.instruments = {instrument}, rig.instruments[0].marker.hues_deg = hues_deg; }))
          return fmt::format(
              "{} is found with its hues in another order: write hues_deg: [{}], from the trocar to the tip, into the "
              "rig",
              instrument.name, fmt::join(hues_deg, ", "));
      }
    }
    return "";
  }

  std::string other_diameter() const {
    for (const auto& [times, text] : {std::pair{2.0, "twice"}, {0.5, "half"}})
      for (const Instrument& instrument : rig_.instruments) {
        const double diameter_m = times * instrument.marker.diameter_m;
        if (found_with_rig(
                [&](Rig& rig) { rig.instruments = {instrument}, rig.instruments[0].marker.diameter_m = diameter_m; }))
          return fmt::format(
              "{} is found with a diameter of {:.2f} mm, {} the rig's: diameter_m is the diameter, by callipers, and "
              "not the radius",
              instrument.name, 1e3 * diameter_m, text);
      }
    return "";
  }

  std::string other_camera() const {
    if (rig_.camera.distorted() && found_with_rig([](Rig& rig) { rig.camera.distortion = {}; }))
      return "the instrument is found without the rig's distortion_coefficients: images that are already undistorted "
             "(image_rect) need a rig without them; else lapservo calibrate camera";
    constexpr double step = 1.08;  // the marker is found within half a step; a misprint is not found two steps away
    for (int steps = 2; steps <= 9; ++steps)
      for (const double times : {std::pow(step, -steps), std::pow(step, steps)})
        if (found_with_rig([&](Rig& rig) { rig.camera.fx_px *= times, rig.camera.fy_px *= times; }))
          return fmt::format(
              "the instrument is found with a focal length of about {:.0f} px, where the rig has {:.0f}: lapservo "
              "calibrate camera measures it",
              times * rig_.camera.fx_px, rig_.camera.fx_px);
    return "";
  }

  const std::vector<cv::Mat>& frames_;
  const Rig& rig_;
  bool deinterlaced_;
};

// On the line that faces the camera.
std::optional<BandShares> shares_in(const Observation& observation) {
  using What = Observation::Refused::What;
  const bool is_ok = observation.status == Status::ok;
  if (!is_ok && observation.refused.what != What::edges) return std::nullopt;
  const auto& edges = is_ok ? observation.edges_raw_px : observation.refused.edges_raw_px;
  const double length_px = (edges[3] - edges[0]).norm();
  BandShares shares{};
  for (std::size_t i = 0; i < shares.size(); ++i) shares[i] = (edges[i + 1] - edges[i]).norm() / length_px;
  return shares;
}

// "3.5 to 17.0", of the shortest and the longest.
std::string range_mm(double a_m, double b_m) {
  const auto [low, high] = std::minmax({1000 * a_m, 1000 * b_m});
  return high - low < 0.1 ? fmt::format("{:.1f}", low) : fmt::format("{:.1f} to {:.1f}", low, high);
}

std::string text_of(const Marker& marker, const std::vector<BandShares>& seen) {
  std::array<std::string, 3> seen_mm, rig_mm;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto [low, high] = std::ranges::minmax_element(seen, {}, [i](const BandShares& shares) { return shares[i]; });
    seen_mm[i] = range_mm((*low)[i] * marker.length_m(), (*high)[i] * marker.length_m());
    rig_mm[i] = range_mm(marker.bands_upper_m[i], marker.bands_lower_m[i]);
  }
  return fmt::format(
      "the rig's colours are found in their order, but its bands do not fit: if the print is {:.1f} mm long, as in the "
      "rig, they are {}, {} and {} mm long where they face the camera, in the rig {}, {} and {} mm: write the print's "
      "bands_upper_m and bands_lower_m into the rig",
      1000 * marker.length_m(), seen_mm[0], seen_mm[1], seen_mm[2], rig_mm[0], rig_mm[1], rig_mm[2]);
}

}  // namespace

std::string found_otherwise(const std::vector<cv::Mat>& frames, const Rig& rig, bool deinterlaced) {
  return OtherReadings(frames, rig, deinterlaced).first();
}

bool shows_q_when_turned(const std::vector<cv::Mat>& frames, const Rig& rig, bool deinterlaced) {
  Tracker tracker(rig, {.single = true, .deinterlace = deinterlaced});
  return most(frames, [&](const cv::Mat& frame) {
    cv::Mat turned;
    cv::rotate(frame, turned, cv::ROTATE_180);
    return std::ranges::any_of(tracker.track(turned), [](const Observation& seen) { return seen.rcm.has_value(); });
  });
}

std::string seen_other_bands(const std::vector<cv::Mat>& frames, const Rig& rig, bool deinterlaced) {
  const auto is_readable = [](const Instrument& instrument) { return decoding_problem(instrument.marker).empty(); };
  if (!std::ranges::all_of(rig.instruments, is_readable)) return "";
  std::vector<std::vector<BandShares>> others(rig.instruments.size());
  for (const cv::Mat& frame : frames) {
    const auto observations = Tracker(rig, {.method = Method::centerline, .deinterlace = deinterlaced}).track(frame);
    for (std::size_t i = 0; i < observations.size(); ++i) {
      const auto seen = shares_in(observations[i]);
      if (seen && !has_band_shares(rig.instruments[i].marker, *seen)) others[i].push_back(*seen);
    }
  }
  for (std::size_t i = 0; i < others.size(); ++i)
    if (2 * others[i].size() > frames.size()) return text_of(rig.instruments[i].marker, others[i]);
  return "";
}

}  // namespace lapservo::internal
