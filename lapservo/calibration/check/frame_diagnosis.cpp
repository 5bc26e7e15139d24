#include "lapservo/calibration/check/frame_diagnosis.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/calibration/check/other_bands.h"
#include "lapservo/calibration/registration/timed_pose.h"
#include "lapservo/core/statistics.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t most_kept = 3;
constexpr int least_missed = 5;       // frames that contradict the rig's RCM before that is reported
constexpr double grey_range = 12;     // of 255: largest minus smallest channel, sensor noise included
constexpr double dark_level = 24;     // of 255
constexpr double pixel_share = 0.99;  // of a frame's pixels that are grey, or dark

double share_below(const cv::Mat& values, double level) {
  return static_cast<double>(cv::countNonZero(values <= level)) / static_cast<double>(values.total());
}

// Largest and smallest channel of each pixel.
std::pair<cv::Mat, cv::Mat> extremes(const cv::Mat& bgr) {
  std::vector<cv::Mat> channels;
  cv::split(bgr, channels);
  const cv::Mat largest = cv::max(cv::max(channels[0], channels[1]), channels[2]);
  const cv::Mat smallest = cv::min(cv::min(channels[0], channels[1]), channels[2]);
  return {largest, smallest};
}

bool is_dark(const cv::Mat& bgr) {
  return share_below(extremes(bgr).first, dark_level) >= pixel_share;
}
bool is_grey(const cv::Mat& bgr) {
  const auto [largest, smallest] = extremes(bgr);
  return share_below(largest - smallest, grey_range) >= pixel_share;
}

// How often an instrument is found in frames that are read in another way.
int found_in(const std::vector<cv::Mat>& frames, const Rig& rig, bool deinterlaced,
             const std::function<cv::Mat(const cv::Mat&)>& read) {
  return static_cast<int>(std::count_if(frames.begin(), frames.end(), [&](const cv::Mat& frame) {
    const auto observations = Tracker(rig, {.deinterlace = deinterlaced}).track(read(frame));
    return std::any_of(observations.begin(), observations.end(),
                       [](const Observation& observation) { return observation.status == Status::ok; });
  }));
}

// The flaw of a frame that the tracker refused.
std::optional<Status> flaw_in(const std::vector<Observation>& observations) {
  for (const Observation& observation : observations)
    if (observation.status == Status::damaged || observation.status == Status::few_colours) return observation.status;
  return std::nullopt;
}

struct Reading {
  const char* cause_and_remedy;
  std::function<cv::Mat(const cv::Mat&)> read;
};

const std::vector<Reading>& readings() {
  static const std::vector<Reading> all{
      {"the instrument is found when red and blue are exchanged: the source writes RGB where BGR is expected (in "
       "Python cv2.cvtColor(image, cv2.COLOR_RGB2BGR))",
       [](const cv::Mat& bgr) {
         cv::Mat exchanged;
         cv::cvtColor(bgr, exchanged, cv::COLOR_BGR2RGB);
         return exchanged;
       }},
      {"the instrument is found when the image is mirrored: switch the camera's or the recorder's mirroring off",
       [](const cv::Mat& bgr) {
         cv::Mat mirrored;
         cv::flip(bgr, mirrored, 1);
         return mirrored;
       }}};
  return all;
}

}  // namespace

FrameDiagnosis::FrameDiagnosis(const Rig& rig, bool deinterlaced) : rig_(rig), deinterlaced_(deinterlaced) {}

void FrameDiagnosis::add(const cv::Mat& bgr, const std::vector<Observation>& observations) {
  ++frames_;
  if (const auto flaw = flaw_in(observations)) {
    flawed_.add(*flaw);
    return;
  }
  bool any_ok = false, interlaced = false;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const Observation& observation = observations[i];
    Seen& seen = seen_[observation.instrument];
    interlaced |= observation.status == Status::interlaced;
    if (observation.status != Status::ok) continue;
    any_ok = true;
    ++seen.ok;
    seen.with_q += observation.rcm ? 1 : 0;
    const auto& camera_from_rcm = rig_.instruments[i].camera_from_rcm;
    if (!camera_from_rcm || observation.rcm || !observation.marker) continue;
    const TimedPose pose{0, *observation.marker};
    seen.misses_m.push_back(pose.miss_m(camera_from_rcm->translation));
    seen.reversed += pose.beyond_m(camera_from_rcm->translation) < 0 ? 1 : 0;
  }
  interlaced_ += interlaced ? 1 : 0;
  if (!any_ok) keep(bgr);
}

// Frames 1, 2, 4, 8 ... of those without a result: early ones, and some from all over a long recording.
void FrameDiagnosis::keep(const cv::Mat& bgr) {
  if (const int count = ++without_result_; (count & (count - 1)) != 0) return;
  if (kept_.size() == most_kept) kept_.erase(kept_.begin() + 1);
  kept_.push_back(bgr.clone());
}

std::string FrameDiagnosis::text() const {
  if (frames_ == 0) return "no frame came: see whether the source sends images";
  const bool any = std::any_of(seen_.begin(), seen_.end(), [](const auto& entry) { return entry.second.ok > 0; });
  if (any) return text_of_missed_rcm();
  const std::string shown = cause_in_frames();
  return shown.empty() ? "no instrument was found: look at the status column, and whether the rig's hues_deg are the "
                         "print's (lapservo calibrate colour measures them)"
                       : shown;
}

std::string FrameDiagnosis::cause() const {
  const std::string shown = cause_in_frames();
  return shown.empty() ? "" : "; " + shown;
}

std::string FrameDiagnosis::cause_in_frames() const {
  if (2 * flawed_.all() > frames_) return flawed_.text(frames_);
  if (kept_.empty()) return "";
  if (!deinterlaced_ && 2 * interlaced_ > frames_)
    return fmt::format("{} of {} frames are interlaced: --deinterlace tracks one field of each", interlaced_, frames_);
  if (std::all_of(kept_.begin(), kept_.end(), is_dark))
    return fmt::format(
        "the frames are nearly black (values up to {:.0f} of 255): look at the light; 16-bit images that hold 8 to "
        "12 bits are to be scaled to the whole range",
        dark_level);
  if (std::all_of(kept_.begin(), kept_.end(), is_grey))
    return "the frames are grey, and the marker is found by its colours: see whether the camera or its driver sends "
           "mono";
  for (const Reading& reading : readings())
    if (2 * found_in(kept_, rig_, deinterlaced_, reading.read) > static_cast<int>(kept_.size()))
      return reading.cause_and_remedy;
  return seen_other_bands(kept_, rig_, deinterlaced_);
}

std::string FrameDiagnosis::text_of_missed_rcm() const {
  for (const auto& [name, seen] : seen_) {
    if (static_cast<int>(seen.misses_m.size()) < least_missed || 2 * seen.with_q >= seen.ok) continue;
    if (2 * static_cast<std::size_t>(seen.reversed) > seen.misses_m.size())
      return fmt::format("{}: in {} of {} frames {}", name, seen.reversed, seen.ok, reversed_marker);
    return fmt::format(
        "{}: in {} of {} frames the shaft misses the rig's RCM, by {:.1f} mm (median): lapservo calibrate registration "
        "measures camera_from_rcm{}",
        name, seen.misses_m.size(), seen.ok, 1000 * median(std::vector(seen.misses_m)),
        rig_.camera.distorted()
            ? "; images that are already undistorted (image_rect) need a rig without distortion_coefficients"
            : "");
  }
  return "";
}

}  // namespace lapservo::internal
