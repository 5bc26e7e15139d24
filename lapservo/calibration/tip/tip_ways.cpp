#include "lapservo/calibration/tip/tip_ways.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "lapservo/calibration/fit/some_of.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/statistics.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t least_poses = 40, enough_poses = 150;  // more are alike
constexpr double least_spread_rad = 0.05;  // rms, of the orientations about the axis about which they differ least
constexpr double play_rad = 0.03;          // what is looser turns back later
constexpr double usual_unmodelled_sigmas = 1.4;  // errors that go with the pose are in no covariance
constexpr int times = 12;                        // slips are looked for at the ends of so many parts of the recording

constexpr auto to_do = "tilt the shaft by 20 degrees or more to all sides and roll it, for 20 s, the tip in its dimple";
constexpr auto hold_wrist = "hold the wrist straight with its motors on, press less, and record again; or use --touch";

double spread_rad(const std::vector<TimedPose>& poses) {
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
  for (const TimedPose& pose : poses)
    mean += pose.marker.camera_from_marker.rotation.toRotationMatrix() / static_cast<double>(poses.size());
  const Eigen::Matrix3d spread = Eigen::Matrix3d::Identity() - mean.transpose() * mean;
  return std::sqrt(std::max(0.0, eigenvalues_of_symmetric(spread)[0]));
}

Eigen::Matrix3Xd moves_of(const std::vector<TimedPose>& poses,
                          const std::function<Eigen::Vector3d(const TimedPose&, double)>& move) {
  const double first_s = poses.front().time_s, span_s = std::max(1e-9, poses.back().time_s - first_s);
  Eigen::Matrix3Xd moves(3, static_cast<Eigen::Index>(poses.size()));
  for (std::size_t i = 0; i < poses.size(); ++i)
    moves.col(static_cast<Eigen::Index>(i)) = move(poses[i], (poses[i].time_s - first_s) / span_s);
  return moves;
}

// A tip that sticks in its dimple is left to the side by the shaft: the mean axis, in the marker's axes, drags a circle
// of the play along.
TipFault loose_wrist(const std::vector<TimedPose>& poses) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const TimedPose& pose : poses) mean += pose.axis();
  Eigen::Vector2d circle = Eigen::Vector2d::Zero();
  return {"the tip stays behind the shaft to either side, as of a loose wrist,",
          hold_wrist,
          {moves_of(poses, [&](const TimedPose& pose, double) {
            const Eigen::Quaterniond& turn = pose.marker.camera_from_marker.rotation;
            const Eigen::Vector2d at = (turn.conjugate() * mean.normalized()).head<2>();
            const double beyond = (at - circle).norm();
            if (beyond > play_rad) circle = at + play_rad / beyond * (circle - at);
            const Eigen::Vector2d side = (at - circle) / play_rad;
            return Eigen::Vector3d(turn * Eigen::Vector3d(side.x(), side.y(), 0));
          })}};
}

std::vector<TipFault> possible_faults(const std::vector<TimedPose>& poses) {
  TipFault drift{"the dimple moves over the recording", "fasten its block and the endoscope, and record again", {}};
  std::vector<TipFault> faults{loose_wrist(poses)};
  for (int k = 0; k < times; ++k) {
    const double at = static_cast<double>(k) / times;
    const auto side = [=](double part) { return part > at ? 0.5 : -0.5; };
    const double at_s = poses.front().time_s + at * (poses.back().time_s - poses.front().time_s);
    TipFault slip{fmt::format("the tip slipped at about {:.0f} s", at_s),
                  "use a deeper dimple, press the tip into it, and record again",
                  {}};
    TipFault bend{fmt::format("the wrist moved at about {:.0f} s, and the tip", at_s), hold_wrist, {}};
    for (Eigen::Index i = 0; i < 3; ++i) {
      const Eigen::Vector3d axis = Eigen::Vector3d::Unit(i);
      if (k == 0) {
        drift.moves.push_back(moves_of(poses, [&](const TimedPose&, double part) { return (part - 0.5) * axis; }));
        continue;
      }
      slip.moves.push_back(moves_of(poses, [&](const TimedPose&, double part) { return side(part) * axis; }));
      if (i == 2) continue;
      bend.moves.push_back(moves_of(poses, [&](const TimedPose& pose, double part) {
        return Eigen::Vector3d(pose.marker.camera_from_marker.rotation * (side(part) * axis));
      }));
    }
    if (k > 0) faults.push_back(slip), faults.push_back(bend);
  }
  faults.push_back(drift);
  return faults;
}

constexpr double touch_sigma_m = 0.1e-3;

std::vector<TipFault> possible_faults(const std::vector<TipSighting>& touches) {
  const auto count = static_cast<Eigen::Index>(touches.size());
  TipFault drift{"the board moves over the touches", "fasten it and the endoscope, and begin anew", {}};
  for (Eigen::Index i = 0; i < 3; ++i)
    drift.moves.emplace_back(Eigen::Vector3d::Unit(i) * Eigen::RowVectorXd::LinSpaced(count, -0.5, 0.5));
  Eigen::Matrix3Xd points(3, count);
  for (Eigen::Index i = 0; i < count; ++i) points.col(i) = *touches[static_cast<std::size_t>(i)].point_in_camera_m;
  points /= points.rowwise().mean().norm();
  return {drift,
          {"the board is nearer or farther than the marker has it",
           "measure its squares and the marker's diameter with callipers",
           {points}}};
}

}  // namespace

TipCalibration pivoted_tip(const Tool& tool, const std::vector<double>& wrist_rad,
                           const std::vector<TimedPose>& all_poses) {
  TipCalibration result;
  const std::vector<TimedPose> poses = some_of(all_poses, enough_poses);
  if (poses.size() < least_poses) {
    result.refusal = fmt::format("the marker is seen in {} frames, {} are needed: record 20 s, the marker in view",
                                 poses.size(), least_poses);
  } else if (!(spread_rad(poses) > least_spread_rad)) {
    result.refusal = fmt::format(
        "the shaft turned about one axis only, as between two orientations, which leaves the tip open along it: {}",
        to_do);
  } else {
    std::vector<TipSighting> sightings;
    for (const TimedPose& pose : poses) sightings.push_back({pose, wrist_rad});
    result = fit_tip(tool, sightings,
                     {possible_faults(poses), 0, usual_unmodelled_sigmas, poses_per_second(poses),
                      "is it in its dimple all the time, is the wrist held straight, does anything else move", to_do});
  }
  return result;
}

TipCalibration touched_tip(const Tool& tool, const std::vector<TipSighting>& touches,
                           const std::vector<std::string>& names) {
  constexpr double outlying = 8, least_outlying_m = 0.5e-3;
  TipCalibration result;
  if (touches.size() < least_touches)
    return result.refusal = fmt::format("{} touches show the marker, {} are needed", touches.size(), least_touches),
           result;
  result = fit_tip(tool, touches,
                   {possible_faults(touches), touch_sigma_m, 1, 1,
                    "is the wrist loose (hold it with its motors on), are the corners the ones that are named",
                    "touch more corners, the shaft tilted and rolled differently"});
  if (result.misses_m.empty()) return result;
  const auto worst = std::max_element(result.misses_m.begin(), result.misses_m.end());
  const double usual_m = median(std::vector<double>(result.misses_m));
  if (*worst > std::max(least_outlying_m, outlying * usual_m))
    result.refusal = fmt::format(
        "{}: the tip is {:.2g} mm from its corner, in most touches {:.2g} mm: is the corner the one that is named, is "
        "the tip on it",
        names[static_cast<std::size_t>(worst - result.misses_m.begin())], 1e3 * *worst, 1e3 * usual_m);
  return result;
}

}  // namespace lapservo::internal
