#include "lapservo/calibration/registration/pose_table.h"

#include <cmath>

#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {

TimedPose pose_in(const CsvTable& table, std::size_t row, const std::string& source) {
  const auto number = [&](const char* column) { return table.number(row, column); };
  const auto sigma = [&](const char* column) {
    if (const double value = number(column); value > 0) return value;
    throw InputError(source, "row " + std::to_string(row + 1) + ": " + column, table.text(row, column), "above 0");
  };
  TimedPose pose;
  pose.time_s = number("time_s");
  pose.marker.camera_from_marker.translation = {number("marker_x_m"), number("marker_y_m"), number("marker_z_m")};
  const Eigen::Quaterniond rotation(number("marker_qw"), number("marker_qx"), number("marker_qy"), number("marker_qz"));
  if (!(std::abs(rotation.norm() - 1) < 2e-4) || !(pose.origin().norm() > 0))
    throw InputError(source, "row " + std::to_string(row + 1) + ": marker pose", "no pose",
                     "a unit quaternion and a place before the camera");
  pose.marker.camera_from_marker.rotation = rotation.normalized();
  pose.marker.sigma_xy_m = sigma("sigma_marker_xy_m"), pose.marker.sigma_z_m = sigma("sigma_marker_z_m");
  pose.marker.sigma_axis_rad = sigma("sigma_axis_rad"), pose.marker.sigma_roll_rad = sigma("sigma_roll_rad");
  return pose;
}

}  // namespace

PoseTable read_poses(const std::filesystem::path& path, const std::string& instrument) {
  const CsvTable table = CsvTable::read(path);
  PoseTable result;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (table.text(row, "instrument") != instrument) continue;
    ++result.rows;
    if (table.text(row, "status") != "ok" || table.text(row, "marker_x_m").empty()) continue;
    if (!table.text(row, "theta_rad").empty()) {
      ++result.with_rcm;
      continue;
    }
    const TimedPose pose = pose_in(table, row, path.string());
    if (!result.poses.empty() && !(pose.time_s > result.poses.back().time_s))
      throw InputError(path.string(), "row " + std::to_string(row + 1) + ": time_s", table.text(row, "time_s"),
                       "later than the row before: the clock jumps");
    result.poses.push_back(pose);
  }
  return result;
}

}  // namespace lapservo::internal
