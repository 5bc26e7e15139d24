#include "lapservo/calibration/registration/axes_meeting_point.h"

#include <algorithm>
#include <cmath>

#include "lapservo/calibration/marker/frame_fit.h"
#include "lapservo/core/dense_matrix.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t min_poses = 20;
constexpr double usual_reach_m = 0.15;     // from the RCM to a marker, about
constexpr double least_spread_rad = 0.03;  // of the axes, rms: of less, noise makes a bundle that meets elsewhere

// Two directions across an axis, a row each, in units of how well a point `reach_m` up the axis is known in them.
Eigen::Matrix<double, 2, 3> across(const TimedPose& pose, double reach_m) {
  const Eigen::Vector3d axis = pose.axis(), ray = pose.origin().normalized();
  Eigen::Matrix<double, 2, 3> directions;
  directions.row(0) = axis.unitOrthogonal().transpose();
  directions.row(1) = axis.cross(directions.row(0).transpose()).transpose();
  const auto& marker = pose.marker;
  const double tilt_m = reach_m * marker.sigma_axis_rad / std::sqrt(2.0);
  Eigen::Matrix3d covariance = (marker.sigma_xy_m * marker.sigma_xy_m + tilt_m * tilt_m) * Eigen::Matrix3d::Identity();
  covariance += marker.sigma_z_m * marker.sigma_z_m * ray * ray.transpose();
  const Eigen::Matrix2d seen = directions * covariance * directions.transpose() + 1e-12 * Eigen::Matrix2d::Identity();
  // Cholesky's factor, by which the rows are divided.
  const double first = std::sqrt(seen(0, 0)), both = seen(1, 0) / first, second = std::sqrt(seen(1, 1) - both * both);
  directions.row(0) /= first;
  directions.row(1) = (directions.row(1) - both * directions.row(0)) / second;
  return directions;
}

}  // namespace

std::optional<AxesMeetingPoint> axes_meeting_point(const std::vector<TimedPose>& poses,
                                                   const AtIteration& at_iteration) {
  if (poses.size() < min_poses) return std::nullopt;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero(), mean = Eigen::Vector3d::Zero();
  for (const TimedPose& pose : poses) {
    const auto weighed = across(pose, usual_reach_m);
    const Eigen::Matrix3d one = weighed.transpose() * weighed;
    information += one, sum += one * pose.origin(), mean += pose.axis() / static_cast<double>(poses.size());
  }
  if (!(1 - mean.squaredNorm() > least_spread_rad * least_spread_rad)) return std::nullopt;
  // Each in units of what it is known to where it passes the point: else noise of the axes draws the point near.
  const FrameResiduals misses = [&](const Eigen::VectorXd& x) {
    Eigen::MatrixXd all(2, static_cast<Eigen::Index>(poses.size()));
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const Eigen::Vector3d arm_m = poses[i].origin() - x;
      all.col(static_cast<Eigen::Index>(i)) = across(poses[i], arm_m.norm()) * arm_m;
    }
    return all;
  };
  const Eigen::Vector3d start_m = solve_symmetric(information, sum);
  const auto fit = fit_frames(misses, {{start_m.x(), 1e-5}, {start_m.y(), 1e-5}, {start_m.z(), 1e-5}},
                              poses_per_second(poses), at_iteration);
  if (!fit) return std::nullopt;
  AxesMeetingPoint result{fit->x, fit->covariance, {}};
  for (const TimedPose& pose : poses) result.misses_m.push_back(pose.miss_m(result.point_m));
  return result;
}

}  // namespace lapservo::internal
