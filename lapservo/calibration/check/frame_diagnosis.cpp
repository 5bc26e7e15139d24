#include "lapservo/calibration/check/frame_diagnosis.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/calibration/check/rig_check.h"
#include "lapservo/calibration/colour/hue_faults.h"
#include "lapservo/calibration/recording/frame_recording.h"
#include "lapservo/calibration/registration/timed_pose.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/statistics.h"
#include "lapservo/marker/band_shares.h"
#include "lapservo/marker/decoder.h"
#include "lapservo/rig/registration_covariance.h"
#include "lapservo/vision/colour/colour_classes.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal {
namespace {

constexpr auto no_frame = "no frame came: see whether the source sends images";
constexpr std::size_t most_kept = 3;
constexpr std::size_t least_missed = 5;  // frames that contradict the rig's RCM before that is reported
constexpr double grey_range = 12;        // of 255: largest minus smallest channel, sensor noise included
constexpr double pixel_share = 0.99;     // of a frame's pixels that are grey

bool is_grey(const cv::Mat& bgr) {
  std::vector<cv::Mat> channels;
  cv::split(bgr, channels);
  const cv::Mat largest = cv::max(cv::max(channels[0], channels[1]), channels[2]);
  const cv::Mat smallest = cv::min(cv::min(channels[0], channels[1]), channels[2]);
  const int grey = cv::countNonZero(largest - smallest <= grey_range);
  return static_cast<double>(grey) / static_cast<double>(bgr.total()) >= pixel_share;
}

bool is_ok(const Observation& seen) {
  return seen.status == Status::ok;
}

// On the line that faces the camera.
std::optional<BandShares> shares_in(const Observation& observation) {
  using What = Observation::Refused::What;
  if (!is_ok(observation) && observation.refused.what != What::edges) return std::nullopt;
  const auto& edges = is_ok(observation) ? observation.edges_raw_px : observation.refused.edges_raw_px;
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

// How many pixels have each of the rig's colours; those of none come first.
std::vector<double> areas_px(const cv::Mat& bgr, const ColourClasses& classes) {
  std::vector<double> areas(static_cast<std::size_t>(classes.count()) + 1);
  for (int v = 0; v < bgr.rows; ++v)
    for (int u = 0; u < bgr.cols; ++u) ++areas[classes(bgr.ptr(v) + 3 * static_cast<std::ptrdiff_t>(u))];
  return areas;
}

// The most pixels that a band has beside the other two, of which one may be hidden; and, as vessels and drops have the
// hues of bands, a whole marker's of the least width that is good enough. The widest marker in view is no bound: its
// bands cover more than the tissue that joins a narrow one.
double most_of_band_px(const Marker& marker, std::size_t band, double others_px) {
  constexpr double one_hidden = 2;
  double beside = 0;
  for (const auto& bands_m : {marker.bands_upper_m, marker.bands_lower_m})
    beside = std::max(beside, bands_m[band] / (bands_m[(band + 1) % 3] + bands_m[(band + 2) % 3]));
  const double narrowest_px2 = rig_limits.width_px * rig_limits.width_px * marker.length_m() / marker.diameter_m;
  return one_hidden * beside * others_px + narrowest_px2;
}

// A few frames, 8-bit BGR, of which most are to show an instrument when they are read in another way; and `shown`,
// empty or a frame that shows one as the rig reads it: a cause that holds for all frames shows it there, too.
class OtherReadings {
 public:
  OtherReadings(const std::vector<cv::Mat>& frames, const Rig& rig, bool deinterlaced, cv::Mat shown = {})
      : frames_(frames), rig_(rig), deinterlaced_(deinterlaced), shown_(std::move(shown)) {}

  // The cause and its remedy where another order of channels, mirroring, other hues, another diameter, lens or focal
  // length shows it; else empty.
  std::string found() const {
    for (const auto& reading : {&OtherReadings::other_images, &OtherReadings::other_hues,
                                &OtherReadings::other_diameter, &OtherReadings::other_camera})
      if (std::string found = (this->*reading)(); !found.empty()) return found;
    return "";
  }

  bool shows_q_when_turned() const {
    return most_show([](const cv::Mat& from, cv::Mat& to) { cv::rotate(from, to, cv::ROTATE_180); },
                     [](const Observation& seen) { return seen.rcm.has_value(); });
  }

  // One line with the lengths that are seen where a marker has them at no azimuth; else empty.
  std::string other_bands() const {
    const auto is_readable = [](const Instrument& instrument) { return decoding_problem(instrument.marker).empty(); };
    if (!std::ranges::all_of(rig_.instruments, is_readable)) return "";
    std::vector<std::vector<BandShares>> others(rig_.instruments.size());
    for (const cv::Mat& frame : frames_) {
      const auto observations =
          Tracker(rig_, {.method = Method::centerline, .deinterlace = deinterlaced_}).track(frame);
      for (std::size_t i = 0; i < observations.size(); ++i) {
        const auto seen = shares_in(observations[i]);
        if (seen && !has_band_shares(rig_.instruments[i].marker, *seen)) others[i].push_back(*seen);
      }
    }
    for (std::size_t i = 0; i < others.size(); ++i)
      if (2 * others[i].size() > frames_.size()) return text_of(rig_.instruments[i].marker, others[i]);
    return "";
  }

 private:
  // Ends as soon as it is decided.
  template <typename Wanted>
  bool most(Wanted wanted) const {
    std::size_t with = 0, without = 0;
    for (const cv::Mat& frame : frames_) {
      ++(wanted(frame) ? with : without);
      if (2 * with > frames_.size()) return shown_.empty() || wanted(shown_);
      if (2 * without >= frames_.size()) return false;
    }
    return false;
  }

  template <typename Change, typename Wanted>
  bool most_show(Change change, Wanted wanted) const {
    Tracker tracker(rig_, {.single = true, .deinterlace = deinterlaced_});
    return most([&](const cv::Mat& frame) {
      cv::Mat changed;
      change(frame, changed);
      return std::ranges::any_of(tracker.track(changed), wanted);
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
    return most([&](const cv::Mat& frame) { return std::ranges::any_of(tracker.track(frame), is_ok); });
  }

  std::string other_images() const {
    if (most_show([](const cv::Mat& from, cv::Mat& to) { cv::cvtColor(from, to, cv::COLOR_BGR2RGB); }, is_ok))
      return "the instrument is found when red and blue are exchanged: the source writes RGB where BGR is expected (in "
             "Python cv2.cvtColor(image, cv2.COLOR_RGB2BGR))";
    if (most_show([](const cv::Mat& from, cv::Mat& to) { cv::flip(from, to, 1); }, is_ok))
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
        Instrument other = instrument;
        const double diameter_m = other.marker.diameter_m *= times;
        other.marker.tolerance_m = std::max(other.marker.tolerance_m, uncalibrated_tolerance_m);
        if (found_with_rig([&](Rig& rig) { rig.instruments = {other}; }))
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
  cv::Mat shown_;
};

}  // namespace

const char* usual_cause(Status status) {
  switch (status) {
    case Status::ok:
      return "";
    case Status::no_marker:
      return "the rig's hues_deg are not seen in their order: the marker is out of view, or its hues are others; "
             "lapservo calibrate colour measures them";
    case Status::cut:
      return "the marker is cut by the image's border; move the endoscope or the instrument";
    case Status::occluded:
      return "blood, smoke, reflections or another instrument hide boundaries; clean the marker, move what covers it";
    case Status::ambiguous:
      return "two explanations fit: large parts are hidden or blurred, or two markers are alike; clean the marker, "
             "focus, use other orders of hues";
    case Status::poor_fit:
      return "what has the marker's hues is not as the rig says; compare diameter_m and bands with the print, and the "
             "focal length with the camera's";
    case Status::uncertain:
      return "the marker is too small, too dark, blurred or compressed for psi; come nearer, more light, a shorter "
             "exposure, less compression, and where the rig's sigma_camera_matrix or sigma_response is large, lapservo "
             "calibrate camera. Or it is hidden in part and misses the rig's RCM: lapservo calibrate registration";
    case Status::marker_mismatch:
      return "the print is not as the rig says; lapservo calibrate marker measures it from a slow turn";
    case Status::damaged:
      return "the decoder reports damaged frames; repair what carries them, or record them again";
    case Status::interlaced:
      return "the frames are interlaced; --deinterlace tracks one field of each";
    case Status::blended:
      return "frames are the sum of two moments; switch off the recorder's noise reduction over time (3D NR, temporal "
             "denoise) and every conversion of the frame rate";
  }
  return "";
}

std::string tissue_hue_text(const Marker& marker) {
  // Tissue, blood and fat are bluish red to yellow, by a few degrees more where the white balance is off.
  constexpr double first_deg = -26, last_deg = 41;
  constexpr double lowest_deg = last_deg + colour_limits.widest_reach_deg,
                   highest_deg = whole_turn_deg + first_deg - colour_limits.widest_reach_deg;
  for (std::size_t band = 0; band < 3; ++band)
    if (const double hue_deg = marker.hues_deg[band]; hue_deg < lowest_deg || hue_deg > highest_deg)
      return fmt::format(
          "hues_deg[{}] is {:g}, near the hues of tissue, blood and fat: before these the marker may not be found; "
          "print it with hues of {:g} to {:g} degrees",
          band, hue_deg, lowest_deg, highest_deg);
  return "";
}

void MissedRcm::add_missed(const Observation::MarkerPose& marker, const Eigen::Vector3d& rcm_m) {
  const TimedPose pose{0, marker};
  misses_m.push_back(pose.miss_m(rcm_m));
  reversed += pose.beyond_m(rcm_m) < 0 ? 1 : 0;
}

bool MissedRcm::is_wrong() const {
  return misses_m.size() >= least_missed && 2 * misses_m.size() > static_cast<std::size_t>(shown);
}

std::string MissedRcm::text() const {
  if (is_reversed()) return fmt::format("in {} of {} frames {}", reversed, shown, reversed_marker);
  return fmt::format("in {} of {} frames {}, by {:.1f} mm (median)", misses_m.size(), shown, misses_rcm_text,
                     misses_m.empty() ? 0 : 1000 * median(std::vector(misses_m)));
}

void FrameDiagnosis::add(const cv::Mat& bgr, const std::vector<Observation>& observations) {
  ++frames_;
  const auto any = [&](Status status) { return std::ranges::count(observations, status, &Observation::status) > 0; };
  if (any(Status::damaged)) {
    for (const Observation& observation : observations) ++seen_[observation.instrument].refused[observation.status];
    ++without_instrument_, ++damaged_;
    return;
  }
  bool any_result = false;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const Observation& observation = observations[i];
    Seen& seen = seen_[observation.instrument];
    if (observation.status != Status::ok) {
      ++seen.refused[observation.status];
      continue;
    }
    ++seen.missed.shown;
    if (observation.marker)
      seen.lights.add([&] {
        return light_of_marker(bgr, rig_.camera, rig_.instruments[i].marker,
                               {observation.camera_from_unrolled, observation.psi_rad});
      });
    const auto& camera_from_rcm = rig_.instruments[i].camera_from_rcm;
    any_result |= observation.rcm || !camera_from_rcm;
    if (!camera_from_rcm || observation.rcm || !observation.marker) continue;
    seen.missed.add_missed(*observation.marker, camera_from_rcm->translation);
  }
  interlaced_ += any(Status::interlaced) ? 1 : 0;
  blended_ += any(Status::blended) ? 1 : 0;
  without_instrument_ += any(Status::ok) ? 0 : 1;
  if (!any_result)
    keep(bgr);
  else if (shown_.empty())
    shown_ = bgr.clone();
}

// Frames 1, 2, 4, 8 ... of those without a result: early ones, and some from all over a long recording.
void FrameDiagnosis::keep(const cv::Mat& bgr) {
  if (const int count = ++without_result_; (count & (count - 1)) != 0) return;
  if (kept_.size() == most_kept) kept_.erase(kept_.begin() + 1);
  kept_.push_back(bgr.clone());
}

std::string FrameDiagnosis::text(bool lossy) const {
  if (frames_ == 0) return no_frame;
  const bool seldom_shown = 2 * without_instrument_ > frames_;
  std::string shown = seldom_shown ? cause_in_frames() : text_of_missed_rcm();
  if (shown.empty()) shown = text_of_moving_hues();
  return shown.empty() && seldom_shown ? text_of_refusals(lossy) : shown;
}

std::string FrameDiagnosis::text_of_refusals(bool lossy) const {
  std::string name;
  Status status = Status::ok;
  int count = 0;
  for (const auto& [instrument, seen] : seen_)
    for (const auto& [refusal, frames] : seen.refused)
      if (frames > count) name = instrument, status = refusal, count = frames;
  if (count == 0) return "";
  if (lossy && comes_by_compression(status))
    return fmt::format(
        "{}: {} of {} frames are {}, and the recording is compressed: record without losses or at a higher bit rate",
        name, count, frames_, to_string(status));
  const auto instrument = std::ranges::find(rig_.instruments, name, &Instrument::name) - rig_.instruments.begin();
  return fmt::format("{}: {} of {} frames are {}: {}{}", name, count, frames_, to_string(status), usual_cause(status),
                     status == Status::no_marker ? background(static_cast<std::size_t>(instrument)) : "");
}

std::string FrameDiagnosis::background(std::size_t instrument) const {
  const ColourClasses classes(rig_.instruments);
  const Marker& marker = rig_.instruments[instrument].marker;
  const auto& bands = classes.of_bands(instrument);
  std::vector<std::vector<double>> all_px;
  for (const cv::Mat& frame : kept_) all_px.push_back(areas_px(frame, classes));
  for (std::size_t band = 0; band < bands.size(); ++band) {
    const auto covers_more = [&](const std::vector<double>& px) {
      const double others_px = px[bands[(band + 1) % 3]] + px[bands[(band + 2) % 3]];
      return px[bands[band]] > most_of_band_px(marker, band, others_px);
    };
    if (2 * static_cast<std::size_t>(std::ranges::count_if(all_px, covers_more)) <= all_px.size()) continue;
    return fmt::format(
        "; or the background has the hue of a band: {:.0f} % of the image are near {:g} degrees, more than a marker "
        "covers; print it with another hue, or change the background",
        100 * all_px.back()[bands[band]] / static_cast<double>(kept_.back().total()), marker.hues_deg[band]);
  }
  return "";
}

std::string FrameDiagnosis::cause() const {
  if (frames_ == 0) return std::string("; ") + no_frame;
  std::string shown = cause_in_frames();
  if (shown.empty()) shown = text_of_refusals(false);
  return shown.empty() ? "" : "; " + shown;
}

std::string FrameDiagnosis::cause_in_frames() const {
  if (2 * damaged_ > frames_) return text_of_damaged(damaged_, frames_);
  if (kept_.empty()) return "";
  if (!deinterlaced_ && 2 * interlaced_ > frames_)
    return fmt::format("{} of {} frames are interlaced: --deinterlace tracks one field of each", interlaced_, frames_);
  // Most frames of a blended recording are refused for what the blending does to them.
  if (blended_ > 0) return fmt::format("{} of {} {}", blended_, frames_, usual_cause(Status::blended));
  std::vector<PictureLight> lights;
  std::ranges::transform(kept_, std::back_inserter(lights), light_of_picture);
  if (std::ranges::all_of(lights, &PictureLight::dark)) return dark_pictures;
  if (std::ranges::all_of(kept_, is_grey))
    return "the frames are grey, and the marker is found by its colours: see whether the camera or its driver sends "
           "mono";
  const OtherReadings otherwise(kept_, rig_, deinterlaced_, shown_);
  if (std::string found = otherwise.found(); !found.empty()) return found;
  if (std::ranges::all_of(lights, &PictureLight::overexposed))
    return "the frames are overexposed, and their hues with them: lower the exposure, the gain or the light";
  return shown_.empty() ? otherwise.other_bands() : "";
}

std::string FrameDiagnosis::text_of_moving_hues() const {
  for (std::size_t i = 0; i < rig_.instruments.size(); ++i) {
    const auto seen = seen_.find(rig_.instruments[i].name);
    if (seen == seen_.end() || seen->second.missed.shown >= rig_limits.found * frames_) continue;
    std::vector<FrameHues> hues;
    for (const auto& light : seen->second.lights.items())
      if (light) hues.push_back(frame_hues(*light, rig_.instruments[i].marker));
    if (hues.empty()) continue;
    for (const HueFault& fault : recorded_hues(hues).faults)
      if (fault.size_deg > rig_limits.hue_deg)
        return fmt::format("{}: {} of {} frames do not show it, and in those that do {}", seen->first,
                           frames_ - seen->second.missed.shown, frames_, fault.text());
  }
  return "";
}

std::string FrameDiagnosis::text_of_missed_rcm() const {
  for (const auto& [name, seen] : seen_) {
    if (!seen.missed.is_wrong()) continue;
    if (OtherReadings(kept_, rig_, deinterlaced_).shows_q_when_turned())
      return fmt::format(
          "{}: the shaft passes the rig's RCM when the image is turned by 180 degrees: turn the camera as it was when "
          "camera_from_rcm was measured, or measure it anew by lapservo calibrate registration",
          name);
    if (seen.missed.is_reversed()) return fmt::format("{}: {}", name, seen.missed.text());
    return fmt::format(
        "{}: {}: {}{}", name, seen.missed.text(), measure_registration_text,
        rig_.camera.distorted()
            ? "; images that are already undistorted (image_rect) need a rig without distortion_coefficients"
            : "");
  }
  return "";
}

}  // namespace lapservo::internal
