#include "lapservo/calibration/check/frame_diagnosis.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/calibration/check/other_bands.h"
#include "lapservo/calibration/check/other_readings.h"
#include "lapservo/calibration/check/usual_cause.h"
#include "lapservo/calibration/recording/frame_recording.h"
#include "lapservo/calibration/recording/picture_light.h"
#include "lapservo/calibration/registration/timed_pose.h"
#include "lapservo/core/statistics.h"
#include "lapservo/rig/registration_text.h"

namespace lapservo::internal {
namespace {

constexpr auto no_frame = "no frame came: see whether the source sends images";
constexpr std::size_t most_kept = 3;
constexpr int least_missed = 5;       // frames that contradict the rig's RCM before that is reported
constexpr double grey_range = 12;     // of 255: largest minus smallest channel, sensor noise included
constexpr double pixel_share = 0.99;  // of a frame's pixels that are grey

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

bool is_grey(const cv::Mat& bgr) {
  const auto [largest, smallest] = extremes(bgr);
  return share_below(largest - smallest, grey_range) >= pixel_share;
}

// Whether the tracker refused the frame.
bool is_damaged(const std::vector<Observation>& observations) {
  return std::any_of(observations.begin(), observations.end(),
                     [](const Observation& observation) { return observation.status == Status::damaged; });
}

}  // namespace

FrameDiagnosis::FrameDiagnosis(const Rig& rig, bool deinterlaced) : rig_(rig), deinterlaced_(deinterlaced) {}

void FrameDiagnosis::add(const cv::Mat& bgr, const std::vector<Observation>& observations) {
  ++frames_;
  if (is_damaged(observations)) {
    for (const Observation& observation : observations) ++seen_[observation.instrument].refused[observation.status];
    ++without_instrument_;
    ++damaged_;
    return;
  }
  bool any_ok = false, any_result = false, interlaced = false, blended = false;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const Observation& observation = observations[i];
    Seen& seen = seen_[observation.instrument];
    interlaced |= observation.status == Status::interlaced;
    blended |= observation.status == Status::blended;
    if (observation.status != Status::ok) {
      ++seen.refused[observation.status];
      continue;
    }
    any_ok = true;
    ++seen.ok;
    seen.with_q += observation.rcm ? 1 : 0;
    const auto& camera_from_rcm = rig_.instruments[i].camera_from_rcm;
    any_result |= observation.rcm || !camera_from_rcm;
    if (!camera_from_rcm || observation.rcm || !observation.marker) continue;
    const TimedPose pose{0, *observation.marker};
    seen.misses_m.push_back(pose.miss_m(camera_from_rcm->translation));
    seen.reversed += pose.beyond_m(camera_from_rcm->translation) < 0 ? 1 : 0;
  }
  interlaced_ += interlaced ? 1 : 0;
  blended_ += blended ? 1 : 0;
  without_instrument_ += any_ok ? 0 : 1;
  if (!any_result) keep(bgr);
}

// Frames 1, 2, 4, 8 ... of those without a result: early ones, and some from all over a long recording.
void FrameDiagnosis::keep(const cv::Mat& bgr) {
  if (const int count = ++without_result_; (count & (count - 1)) != 0) return;
  if (kept_.size() == most_kept) kept_.erase(kept_.begin() + 1);
  kept_.push_back(bgr.clone());
}

std::string FrameDiagnosis::text(bool lossy) const {
  if (frames_ == 0) return no_frame;
  if (2 * without_instrument_ <= frames_) return text_of_missed_rcm();
  const std::string shown = cause_in_frames(without_instrument_ == frames_);
  return shown.empty() ? text_of_refusals(lossy) : shown;
}

std::optional<FrameDiagnosis::Refusal> FrameDiagnosis::most_frequent() const {
  std::optional<Refusal> most;
  for (const auto& [name, seen] : seen_)
    for (const auto& [status, count] : seen.refused)
      if (!most || count > most->frames) most = Refusal{name, status, count};
  return most;
}

std::string FrameDiagnosis::text_of_refusals(bool lossy) const {
  const auto most = most_frequent();
  if (!most) return "";
  const auto& [name, status, count] = *most;
  if (lossy && comes_by_compression(status))
    return fmt::format(
        "{}: {} of {} frames are {}, and the recording is compressed: record without losses or at a higher bit rate",
        name, count, frames_, to_string(status));
  return fmt::format("{}: {} of {} frames are {}: {}", name, count, frames_, to_string(status), usual_cause(status));
}

std::string FrameDiagnosis::cause() const {
  if (frames_ == 0) return std::string("; ") + no_frame;
  std::string shown = cause_in_frames(true);
  if (shown.empty()) shown = text_of_refusals(false);
  return shown.empty() ? "" : "; " + shown;
}

std::string FrameDiagnosis::cause_in_frames(bool found_nowhere) const {
  if (2 * damaged_ > frames_) return text_of_damaged(damaged_, frames_);
  if (kept_.empty()) return "";
  if (!deinterlaced_ && 2 * interlaced_ > frames_)
    return fmt::format("{} of {} frames are interlaced: --deinterlace tracks one field of each", interlaced_, frames_);
  // Most frames of a blended recording are refused for what the blending does to them.
  if (blended_ > 0) return fmt::format("{} of {} {}", blended_, frames_, usual_cause(Status::blended));
  std::vector<PictureLight> lights;
  std::transform(kept_.begin(), kept_.end(), std::back_inserter(lights), light_of_picture);
  if (std::all_of(lights.begin(), lights.end(), std::mem_fn(&PictureLight::dark))) return dark_pictures;
  if (std::all_of(kept_.begin(), kept_.end(), is_grey))
    return "the frames are grey, and the marker is found by its colours: see whether the camera or its driver sends "
           "mono";
  if (found_nowhere)
    if (std::string found = found_otherwise(kept_, rig_, deinterlaced_); !found.empty()) return found;
  if (std::all_of(lights.begin(), lights.end(), std::mem_fn(&PictureLight::overexposed)))
    return "the frames are overexposed, and their hues with them: lower the exposure, the gain or the light";
  return found_nowhere ? seen_other_bands(kept_, rig_, deinterlaced_) : "";
}

std::string FrameDiagnosis::text_of_missed_rcm() const {
  for (const auto& [name, seen] : seen_) {
    if (static_cast<int>(seen.misses_m.size()) < least_missed || 2 * seen.with_q >= seen.ok) continue;
    if (shows_q_when_turned(kept_, rig_, deinterlaced_))
      return fmt::format(
          "{}: the shaft passes the rig's RCM when the image is turned by 180 degrees: turn the camera as it was when "
          "camera_from_rcm was measured, or measure it anew by lapservo calibrate registration",
          name);
    if (2 * static_cast<std::size_t>(seen.reversed) > seen.misses_m.size())
      return fmt::format("{}: in {} of {} frames {}", name, seen.reversed, seen.ok, reversed_marker);
    return fmt::format(
        "{}: in {} of {} frames {}, by {:.1f} mm (median): {}{}", name, seen.misses_m.size(), seen.ok, misses_rcm_text,
        1000 * median(std::vector(seen.misses_m)), measure_registration_text,
        rig_.camera.distorted()
            ? "; images that are already undistorted (image_rect) need a rig without distortion_coefficients"
            : "");
  }
  return "";
}

}  // namespace lapservo::internal
