#include "lapservo/calibration/registration/axes_meeting_point.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

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

// The numbers of the fit: the point, then the faults that are held at 0. The point lies as far from the middle of the
// motion as it is there at other times, rms: so its sigma counts the motion.
constexpr Eigen::Index motion = 3, tilt = 6, bend = 7, numbers = 9;

// The axis' way past the point, as the numbers have both.
Eigen::Vector2d miss(TimedPose pose, double part_of_time, const Eigen::VectorXd& x) {
  Rigid3& seen = pose.marker.camera_from_marker;
  const Eigen::Vector3d hinge = pose.axis().cross(pose.origin()).normalized();
  const Eigen::Vector3d beside_m = seen.rotation * Eigen::Vector3d(x[bend], x[bend + 1], 0);
  seen.rotation = Eigen::AngleAxisd(x[tilt], hinge) * seen.rotation;
  const double time = part_of_time - 0.5 - 1 / std::sqrt(12.0);
  const Eigen::Vector3d arm_m = pose.origin() + beside_m - (x.head<3>() + time * x.segment<3>(motion));
  return across(pose, arm_m.norm()) * arm_m;
}

// Smaller ones are not worth a word.
std::vector<std::string> texts_of(const std::vector<Fault>& seen) {
  constexpr double least_m = 0.1e-3, least_rad = 5e-3;
  Eigen::VectorXd sizes = Eigen::VectorXd::Zero(numbers);
  for (const Fault& fault : seen)
    if (fault.is_clear) sizes[3 + static_cast<Eigen::Index>(fault.which)] = fault.size;
  std::vector<std::string> texts;
  if (const double moved_m = sizes.segment<3>(motion).norm(); moved_m > least_m)
    texts.push_back(
        fmt::format("the RCM moves by {:.2g} mm over the recording: fasten the trocar, the endoscope and the arm's "
                    "base, and record again",
                    1e3 * moved_m));
  if (const double beside_m = sizes.segment<2>(bend).norm(); beside_m > least_m)
    texts.push_back(
        fmt::format("the shaft's axis passes {:.2g} mm beside the RCM and turns with the shaft: the shaft is bent, or "
                    "the marker sits askew on it",
                    1e3 * beside_m));
  if (std::abs(sizes[tilt]) > least_rad)
    texts.push_back(fmt::format(
        "all axes are tilted by {:.0f} mrad along the view: the print is longer or shorter than the rig's: lapservo "
        "calibrate marker",
        1e3 * std::abs(sizes[tilt])));
  return texts;
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
  const double span_s = std::max(1e-9, poses.back().time_s - poses.front().time_s);
  // Each in units of what it is known to where it passes the point: else noise of the axes draws the point near.
  const FrameResiduals misses = [&](const Eigen::VectorXd& x) {
    Eigen::MatrixXd all(2, static_cast<Eigen::Index>(poses.size()));
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const double part = (poses[i].time_s - poses.front().time_s) / span_s;
      all.col(static_cast<Eigen::Index>(i)) = miss(poses[i], part, x);
    }
    return all;
  };
  const Eigen::Vector3d start_m = solve_symmetric(information, sum);
  constexpr double step_m = 1e-5, step_rad = 1e-4;
  std::vector<Unknown> unknowns(numbers, {0, step_m});
  for (std::size_t i = 0; i < 3; ++i) unknowns[i].start = start_m[static_cast<Eigen::Index>(i)];
  unknowns[tilt].step = step_rad;
  const auto fit = fit_frames(misses, unknowns, poses_per_second(poses), at_iteration, numbers - 3);
  if (!fit) return std::nullopt;
  AxesMeetingPoint result{fit->x, fit->covariance, {}, texts_of(fit->departures.seen), {}};
  result.by_faults = fit->departures.by_seen + fit->departures.by_instead;
  for (const TimedPose& pose : poses) result.misses_m.push_back(pose.miss_m(result.point_m));
  return result;
}

}  // namespace lapservo::internal
