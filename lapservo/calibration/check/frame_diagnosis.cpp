#include "lapservo/calibration/check/frame_diagnosis.h"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/calibration/check/other_readings.h"
#include "lapservo/calibration/colour/light.h"
#include "lapservo/calibration/recording/frame_recording.h"
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

bool is_grey(const cv::Mat& bgr) {
  std::vector<cv::Mat> channels;
  cv::split(bgr, channels);
  const cv::Mat largest = cv::max(cv::max(channels[0], channels[1]), channels[2]);
  const cv::Mat smallest = cv::min(cv::min(channels[0], channels[1]), channels[2]);
  const int grey = cv::countNonZero(largest - smallest <= grey_range);
  return static_cast<double>(grey) / static_cast<double>(bgr.total()) >= pixel_share;
}

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
             "calibrate camera";
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
    ++seen.ok;
    seen.with_q += observation.rcm ? 1 : 0;
    const auto& camera_from_rcm = rig_.instruments[i].camera_from_rcm;
    any_result |= observation.rcm || !camera_from_rcm;
    if (!camera_from_rcm || observation.rcm || !observation.marker) continue;
    const TimedPose pose{0, *observation.marker};
    seen.misses_m.push_back(pose.miss_m(camera_from_rcm->translation));
    seen.reversed += pose.beyond_m(camera_from_rcm->translation) < 0 ? 1 : 0;
  }
  interlaced_ += any(Status::interlaced) ? 1 : 0;
  blended_ += any(Status::blended) ? 1 : 0;
  without_instrument_ += any(Status::ok) ? 0 : 1;
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
  std::ranges::transform(kept_, std::back_inserter(lights), light_of_picture);
  if (std::ranges::all_of(lights, &PictureLight::dark)) return dark_pictures;
  if (std::ranges::all_of(kept_, is_grey))
    return "the frames are grey, and the marker is found by its colours: see whether the camera or its driver sends "
           "mono";
  if (found_nowhere)
    if (std::string found = found_otherwise(kept_, rig_, deinterlaced_); !found.empty()) return found;
  if (std::ranges::all_of(lights, &PictureLight::overexposed))
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
