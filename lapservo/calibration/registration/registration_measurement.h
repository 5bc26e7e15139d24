#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "lapservo/calibration/recording/frame_recording.h"
#include "lapservo/calibration/registration/registration.h"
#include "lapservo/calibration/registration/timed_pose.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// Where the marker was, by the image alone.
struct MeasuredPoses {
  std::vector<TimedPose> all;
  std::string none;  ///< why there are none
  FramesRead read;
};

/// From a marker in motion, tracked without the quantities to measure. Throws InputError as read_frames().
MeasuredPoses poses_in_frames(const Rig& rig, std::size_t instrument, const FrameRecording& recording,
                              const JobWatch& watch);

/// The poses of one instrument's marker in a CSV of observations (docs/output.md). Rows that were measured with a
/// camera_from_rcm are left out: their axes pass through it whether it is right or not. Throws InputError for a table
/// of another kind, for numbers that are none and for times that fall.
MeasuredPoses poses_in_table(const std::filesystem::path& path, const std::string& instrument);

/// The instrument with what was measured; what was not stays, the uncertainty of a rotation that stays included.
Instrument registered(Instrument instrument, const Registration& registration);

/// Results in mm, mrad and ms; `before` is NaN where the rig had no value. `before` has the joints that the
/// registration was made with.
std::vector<CalibratedNumber> registered_numbers(const Instrument& before, const Registration& registration);

}  // namespace lapservo::internal
