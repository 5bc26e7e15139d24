#include "lapservo/calibration/registration/delay_search.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/LU>

#include "lapservo/core/angles.h"

namespace lapservo::internal {
namespace {

constexpr double step_s = 0.01, lag_s = 0.2;
constexpr std::size_t fewest = 15;

// Least squares of one number by two others, with or without a constant.
class Regression {
 public:
  explicit Regression(bool constant) : constant_(constant) {}

  void add(double y, double a, double b) {
    const Eigen::Vector3d row(a, b, constant_ ? 1 : 0);
    information_ += row * row.transpose(), right_ += y * row, squares_ += y * y, sum_ += y, ++count_;
  }
  std::size_t count() const { return count_; }
  Eigen::Vector3d slopes() const {
    Eigen::Matrix3d regular = information_;
    regular.diagonal() += Eigen::Vector3d::Constant(1e-9 * information_.trace() + 1e-300);
    return regular.inverse() * right_;
  }
  // 1 - the variance that is left over what there was.
  double explained() const {
    const double n = static_cast<double>(count_), all = squares_ - (constant_ ? sum_ * sum_ / n : 0);
    if (!(all > 0)) return 0;
    return std::clamp(1 - (squares_ - right_.dot(slopes())) / all, 0.0, 1 - 1e-6);
  }

 private:
  bool constant_;
  Eigen::Matrix3d information_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right_ = Eigen::Vector3d::Zero();
  double squares_ = 0, sum_ = 0;
  std::size_t count_ = 0;
};

// From one pose to the one that comes a lag later: how far the axis went, and how far the marker turned about it.
struct Step {
  double from_s, to_s, axis_rad_squared, turn_rad;
};

std::vector<Step> steps_of(const std::vector<TimedPose>& poses) {
  std::vector<Step> steps;
  std::size_t to = 0;
  for (const TimedPose& from : poses) {
    while (to < poses.size() && poses[to].time_s < from.time_s + lag_s) ++to;
    if (to == poses.size()) break;
    if (poses[to].time_s > from.time_s + 2 * lag_s) continue;
    const Eigen::Quaterniond turn =
        from.marker.camera_from_marker.rotation.conjugate() * poses[to].marker.camera_from_marker.rotation;
    const double axis_rad = std::acos(std::clamp(from.axis().dot(poses[to].axis()), -1.0, 1.0));
    // The twist about z of the rotation between both.
    steps.push_back({from.time_s, poses[to].time_s, axis_rad * axis_rad, wrap_pi(2 * std::atan2(turn.z(), turn.w()))});
  }
  return steps;
}

struct Trial {
  double score = 0, explained = 0, rho_per_joint = 0;
};

std::optional<Trial> try_delay(const std::vector<TimedPose>& poses, const std::vector<double>& rho_m,
                               const std::vector<Step>& steps, const JointRecording& recording, double delay_s) {
  Regression insertion(true), speed(false), turn(false);
  for (std::size_t i = 0; i < poses.size(); ++i)
    if (const auto at = recording.at(poses[i].time_s - delay_s)) insertion.add(rho_m[i], (*at)[2], 0);
  for (const Step& step : steps) {
    const auto from = recording.at(step.from_s - delay_s), to = recording.at(step.to_s - delay_s);
    if (!from || !to) continue;
    const double theta = (*to)[0] - (*from)[0], phi = (*to)[1] - (*from)[1], psi = (*to)[3] - (*from)[3];
    speed.add(step.axis_rad_squared, theta * theta, phi * phi);
    if (std::abs(psi) < 2.5) turn.add(step.turn_rad, psi, theta);
  }
  if (insertion.count() < std::max(fewest, poses.size() / 3) || speed.count() < fewest) return std::nullopt;
  Trial trial{0, 0, insertion.slopes()[0]};
  for (const Regression* one : {&insertion, &speed, &turn}) {
    trial.score -= std::log1p(-one->explained());
    trial.explained = std::max(trial.explained, one->explained());
  }
  return trial;
}

}  // namespace

DelaySearch search_delay(const std::vector<TimedPose>& poses, const std::vector<double>& rho_m,
                         const JointRecording& recording, double about_s, double reach_s) {
  const auto steps = steps_of(poses);
  DelaySearch best;
  double best_score = -1;
  for (int i = -static_cast<int>(reach_s / step_s); i * step_s <= reach_s; ++i) {
    const double delay_s = about_s + i * step_s;
    const auto trial = try_delay(poses, rho_m, steps, recording, delay_s);
    if (!trial || trial->score <= best_score) continue;
    best_score = trial->score;
    best = {delay_s, trial->explained, trial->rho_per_joint};
  }
  return best;
}

}  // namespace lapservo::internal
