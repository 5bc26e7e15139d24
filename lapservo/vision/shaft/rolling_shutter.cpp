#include "lapservo/vision/shaft/rolling_shutter.h"

#include "lapservo/core/angles.h"

namespace lapservo::internal {
namespace {

double middle_row_px(const Camera& camera, const Marker& marker, const ShaftPose& pose) {
  return camera.raw_from_point(point_on_axis(pose, marker.length_m() / 2)).y();
}

}  // namespace

double exposed_after_s(const Camera& camera, const Marker& marker, const ShaftPose& pose) {
  return camera.readout_s != 0 ? camera.exposed_after_s(middle_row_px(camera, marker, pose)) : 0;
}

RowMotion::RowMotion(const Camera& camera, const Marker& marker, const PoseUnknowns& now, const PoseBefore& before)
    : middle_row_px_(middle_row_px(camera, marker, now.pose())) {
  const double exposed_s = camera.exposed_after_s(middle_row_px_), passed_s = exposed_s - before.time_s;
  if (!(passed_s > 0)) return;
  PoseVector per_s = before.unknowns.change_to(now) / passed_s;  // in the middle of that time
  if (before.step_s > 0) {
    const PoseVector since = passed_s / (passed_s + before.step_s) * (per_s - before.step / before.step_s);
    per_s += since;
    const double turned_rad = two_pi * passed_s;  // of a motion at 1 Hz, as hands have it: its rate changes unevenly
    to_frame_sigma_ = exposed_s * (since.cwiseAbs() + turned_rad * turned_rad / 2 * per_s.cwiseAbs());
  }
  by_row_ = camera.readout_s / camera.height_px * per_s;
  to_frame_ = -exposed_s * per_s;
}

double RowMotion::shift_px(const UnknownVector& row, const Eigen::Vector2d& raw_px,
                           const Eigen::Vector2d& normal) const {
  const double by_row_px = row.head<pose_unknowns>().dot(by_row_);
  return by_row_px * (raw_px.y() - middle_row_px_) / (1 - by_row_px * normal.y());  // the shift moves the row, too
}

}  // namespace lapservo::internal
