#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "lapservo/calibration/registration/timed_pose.h"

namespace lapservo::internal {

/// The poses of one instrument's marker in an observation CSV (docs/output.md). Rows that were measured with a
/// camera_from_rcm are left out: their axes pass through it whether it is right or not. Throws InputError for a table
/// of another kind, for numbers that are none and for times that fall.
struct PoseTable {
  std::vector<TimedPose> poses;
  std::size_t rows = 0;      ///< of this instrument
  std::size_t with_rcm = 0;  ///< left out
};
PoseTable read_poses(const std::filesystem::path& path, const std::string& instrument);

}  // namespace lapservo::internal
