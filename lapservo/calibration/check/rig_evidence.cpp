#include "lapservo/calibration/check/rig_evidence.h"

#include <algorithm>
#include <utility>

#include "lapservo/core/statistics.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/rig/instruments.h"

namespace lapservo::internal {
namespace {

// Where the print is off: it is not to hide what else is wrong.
constexpr double print_tolerance_m = 0.1e-3;

// Without a registration that bends poses, and without what the rig says of errors that all frames share: as noise of
// each frame they would hide what else is wrong. A tolerance of 0 is exact, a larger one at least the rig's.
Rig free_rig(Rig rig, double tolerance_m, double focal_change) {
  rig = without_sigmas(std::move(rig));
  for (Instrument& instrument : rig.instruments) {
    instrument.camera_from_rcm.reset();
    instrument.marker.tolerance_m = tolerance_m > 0 ? std::max(instrument.marker.tolerance_m, tolerance_m) : 0;
  }
  rig.camera.fx_px *= 1 + focal_change, rig.camera.fy_px *= 1 + focal_change;
  return rig;
}

// The images may have nothing to do with one another, and no robot waits for them.
Tracker whole_search(const Rig& rig) {
  return Tracker(rig, {.frame_budget = std::nullopt});
}

TimedPose::ByFocal slope_of(const Rigid3& before, const Rigid3& after, double focal_change) {
  return {(after.translation - before.translation) / focal_change,
          rotation_vector_of(after.rotation * before.rotation.conjugate()) / focal_change};
}

}  // namespace

RigEvidence::FreeTrackers::FreeTrackers(const Rig& rig, double tolerance_m)
    : at(whole_search(free_rig(rig, tolerance_m, 0))),
      longer(whole_search(free_rig(rig, tolerance_m, focal_step))),
      shorter(whole_search(free_rig(rig, tolerance_m, -focal_step))) {}

RigEvidence::RigEvidence(const Rig& rig, std::size_t instrument, Cores cores)
    : rig_(rig),
      instrument_(instrument),
      as_it_is_(whole_search(rig)),
      exact_(rig, 0),
      tolerant_(rig, print_tolerance_m),
      key_frames_(rig, instrument),
      response_(rig.camera),
      worker_(cores == Cores::two ? 1 : 0) {}

void RigEvidence::look_at_light(const cv::Mat& bgr, const Observation& seen, Unfinished& frame) {
  const Marker& marker = rig_.instruments[instrument_].marker;
  // Each edge costs as much as tracking a frame: some of a long recording's are enough.
  constexpr std::size_t every = 3;
  const ShaftPose pose{seen.camera_from_unrolled, seen.psi_rad};
  if ((frames_.size() + unfinished_.size()) % every == 0) response_.add(bgr, marker, pose);
  frame.light = light_of_marker(bgr, rig_.camera, marker, pose);
  if (!frame.light) return;
  frame.width_px = marker.diameter_m * rig_.camera.fx_px / seen.camera_from_unrolled.translation.z();
}

bool RigEvidence::look_with(FreeTrackers& trackers, const cv::Mat& bgr, double time_s, Unfinished& frame) {
  const Observation& seen = trackers.at.track(bgr)[instrument_];
  if (seen.status != Status::ok) return false;
  look_at_light(bgr, seen, frame);
  if (!seen.marker) return true;
  // From the one to the other, as then errors of either matter least; a wrong focal length made more so may find
  // nothing.
  const auto pose_of = [](const Observation& o, const Observation& otherwise) {
    return (o.status == Status::ok && o.marker ? o : otherwise).marker->camera_from_marker;
  };
  const Observation& longer = trackers.longer.track(bgr)[instrument_];
  const Observation& shorter = trackers.shorter.track(bgr)[instrument_];
  const int steps = (longer.status == Status::ok && longer.marker) + (shorter.status == Status::ok && shorter.marker);
  if (steps > 0)
    poses_.push_back(
        {time_s, *seen.marker, slope_of(pose_of(shorter, seen), pose_of(longer, seen), steps * focal_step)});
  return true;
}

bool RigEvidence::add(const cv::Mat& bgr, double time_s) {
  // The worker's half and this one share nothing, so that both at once find what one after the other would. Some frames
  // apart, as now the one and then the other takes longer.
  constexpr std::size_t most_unfinished = 4;
  finish_all_but(most_unfinished - 1);
  Unfinished unfinished;
  unfinished.as_it_is = worker_.run([this, bgr, time_s](std::size_t) {
    key_frames_.add(bgr, time_s);
    const Observation& seen = as_it_is_.track(bgr)[instrument_];
    FrameEvidence frame{time_s, seen.status, seen.marker ? seen.marker->sigma_roll_rad : 0, seen.marker, {}, {}, 0};
    if (seen.status == Status::ok && seen.rcm) frame.psi_rad = seen.rcm->q.psi_rad;
    return frame;
  });
  pictures_.push_back(light_of_picture(bgr));
  const bool found = look_with(exact_, bgr, time_s, unfinished) || look_with(tolerant_, bgr, time_s, unfinished);
  unfinished_.push_back(std::move(unfinished));
  return found;
}

void RigEvidence::finish_all_but(std::size_t unfinished) const {
  while (unfinished_.size() > unfinished) {
    Unfinished next = std::move(unfinished_.front());
    unfinished_.pop_front();
    FrameEvidence frame = next.as_it_is.get();
    frame.light = next.light, frame.width_px = next.width_px;
    frames_.push_back(frame);
  }
}

std::vector<TrackedPsi> RigEvidence::tracked_psi() const {
  std::vector<TrackedPsi> tracked;
  for (const FrameEvidence& frame : frames())
    if (frame.psi_rad) tracked.push_back({frame.time_s, *frame.psi_rad});
  return tracked;
}

PictureLight RigEvidence::picture() const {
  finish_all_but(0);
  if (pictures_.empty()) return {};
  return {median(values_of(pictures_, &PictureLight::value)), median(values_of(pictures_, &PictureLight::clipped))};
}

int RigEvidence::count(Status status) const {
  return static_cast<int>(std::ranges::count(frames(), status, &FrameEvidence::status));
}

}  // namespace lapservo::internal
