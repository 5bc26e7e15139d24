#include "lapservo/calibration/registration/delay_search.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include <Eigen/LU>

#include "lapservo/calibration/fit/some_of.h"
#include "lapservo/core/angles.h"

namespace lapservo::internal {
namespace {

// A part of a slow motion that is shorter than `least_shared_s` looks like many others.
constexpr double coarse_s = 0.05, fine_s = 1e-3, lag_s = 0.2, least_shared_s = 8;
constexpr std::size_t fewest = 15, enough = 300;

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

class Matcher {
 public:
  Matcher(const std::vector<TimedPose>& poses, const std::vector<double>& rho_m, const JointRecording& recording)
      : recording_(recording), steps_(some_of(steps_of(poses), enough)) {
    std::vector<Place> places;
    for (std::size_t i = 0; i < poses.size(); ++i) places.push_back({poses[i].time_s, rho_m[i]});
    places_ = some_of(std::move(places), enough);
    const double poses_s = poses.back().time_s - poses.front().time_s;
    const double shorter_s = std::min(poses_s, recording.time_s.back() - recording.time_s.front());
    const double needed_s = std::max(shorter_s / 4, std::min(least_shared_s, 0.75 * shorter_s));
    const double part = needed_s / std::max(1e-9, poses_s);
    needed_ = std::max(fewest, static_cast<std::size_t>(part * static_cast<double>(places_.size())));
  }

  // A score below 0 where the recordings share too little.
  DelayMatch at(double delay_s) const {
    Regression insertion(true), speed(false), turn(false);
    for (const Place& place : places_)
      if (const auto at = recording_.at(place.time_s - delay_s)) insertion.add(place.rho_m, (*at)[2], 0);
    for (const Step& step : steps_) {
      const auto from = recording_.at(step.from_s - delay_s), to = recording_.at(step.to_s - delay_s);
      if (!from || !to) continue;
      const double theta = (*to)[0] - (*from)[0], phi = (*to)[1] - (*from)[1], psi = (*to)[3] - (*from)[3];
      speed.add(step.axis_rad_squared, theta * theta, phi * phi);
      if (std::abs(psi) < 2.5) turn.add(step.turn_rad, psi, theta);
    }
    if (insertion.count() < needed_ || speed.count() < fewest) return {delay_s, -1};
    DelayMatch match{delay_s, 0, 0, insertion.slopes()[0]};
    for (const Regression* one : {&insertion, &speed, &turn}) {
      match.score -= std::log1p(-one->explained());
      match.explained = std::max(match.explained, one->explained());
    }
    return match;
  }

  DelayMatch refined(DelayMatch best) const {
    for (double step_s = coarse_s / 2; step_s > fine_s; step_s /= 2)
      for (const double delay_s : {best.delay_s - step_s, best.delay_s + step_s})
        if (const DelayMatch match = at(delay_s); match.score > best.score) best = match;
    return best;
  }

 private:
  struct Place {
    double time_s, rho_m;
  };

  const JointRecording& recording_;
  std::vector<Step> steps_;
  std::vector<Place> places_;
  std::size_t needed_;
};

}  // namespace

std::vector<DelayMatch> search_delay(const std::vector<TimedPose>& poses, const std::vector<double>& rho_m,
                                     const JointRecording& recording, double about_s, double reach_s) {
  // So many peaks, the highest at coarse steps, are refined. The unexplained part of a rival is at most twice that of
  // the best, in each of the three.
  constexpr std::size_t peaks_to_refine = 16;
  const double rival = 3 * std::log(2.0);
  const Matcher matcher(poses, rho_m, recording);
  const int steps = static_cast<int>(reach_s / coarse_s);
  std::vector<DelayMatch> all, peaks;
  for (int i = -steps; i <= steps; ++i) all.push_back(matcher.at(about_s + i * coarse_s));
  for (std::size_t i = 0; i < all.size(); ++i) {
    const double before = i > 0 ? all[i - 1].score : -1, after = i + 1 < all.size() ? all[i + 1].score : -1;
    if (all[i].score >= 0 && all[i].score >= before && all[i].score > after) peaks.push_back(all[i]);
  }
  std::ranges::sort(peaks, std::greater{}, &DelayMatch::score);
  peaks.resize(std::min(peaks.size(), peaks_to_refine));
  for (DelayMatch& peak : peaks) peak = matcher.refined(peak);
  std::ranges::sort(peaks, std::greater{}, &DelayMatch::score);
  std::erase_if(peaks, [best = peaks.empty() ? 0 : peaks.front().score, rival](const DelayMatch& peak) {
    return peak.score < best - rival;
  });
  return peaks;
}

}  // namespace lapservo::internal
