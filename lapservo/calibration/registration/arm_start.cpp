#include "lapservo/calibration/registration/arm_start.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <fmt/format.h>

#include "lapservo/calibration/registration/axes_meeting_point.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/error.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/joint_conversion.h"

namespace lapservo::internal {
namespace {

// Clocks that are set by the network, with a delay of the images.
constexpr double usual_delay_s = 3.2;

// The relation of two recordings of one motion, independent of the arm's place.
struct DelayMatch {
  double delay_s = 0;  // a frame's stamp minus the joints' clock at its exposure
  double score = 0;    // the logarithm of how much less is unexplained than there is, over all that the marker does
  // How much of what the marker does the joints explain at this delay: 0 nothing, 1 all.
  double explained = 0;
  double rho_per_joint = 0;  // slope of the insertion
};

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

// The delay within +-largest_delay_s about `about_s` at which insertion, the axis' speed and the turn about it fit the
// joints best, and after it, the better ones first, those that explain about as much: a motion that repeats has
// several. Empty where the recordings share too little at all of them. `rho_m`: each pose's distance from the RCM
// along its axis.
std::vector<DelayMatch> search_delay(const std::vector<TimedPose>& poses, const std::vector<double>& rho_m,
                                     const JointRecording& recording, double about_s) {
  // So many peaks, the highest at coarse steps, are refined. The unexplained part of a rival is at most twice that of
  // the best, in each of the three.
  constexpr std::size_t peaks_to_refine = 16;
  const double rival = 3 * std::log(2.0);
  const Matcher matcher(poses, rho_m, recording);
  const int steps = static_cast<int>(largest_delay_s / coarse_s);
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

// Frames that the recording covers whichever way the fit moves the delay, and the joints there.
void keep_common(const std::vector<TimedPose>& poses, const JointRecording& recording, ArmStart& start) {
  constexpr double margin_s = 0.1;
  for (const TimedPose& pose : poses) {
    const double time_s = pose.time_s - start.delay_s;
    const auto at = recording.at(time_s);
    if (!at || !recording.at(time_s - margin_s) || !recording.at(time_s + margin_s)) continue;
    start.poses.push_back(pose), start.joints.push_back(*at);
  }
}

void refuse_apart(const std::vector<TimedPose>& poses, const JointRecording& recording, double about_s,
                  const std::string& source) {
  const double first_s = poses.front().time_s - about_s, last_s = poses.back().time_s - about_s;
  const double shared_s = std::min(last_s, recording.time_s.back()) - std::max(first_s, recording.time_s.front());
  if (shared_s > -largest_delay_s) return;
  throw InputError(source,
                   fmt::format("has no time in common with the frames: they run from {:.2f} to {:.2f} s, it from "
                               "{:.2f} to {:.2f} s; subtract what time_s has more, so that both begin within {:.0f} s",
                               first_s, last_s, recording.time_s.front(), recording.time_s.back(), largest_delay_s));
}

std::string clocks_text(const std::vector<TimedPose>& poses, const JointRecording& recording) {
  const double frames_s = poses.back().time_s - poses.front().time_s,
               joints_s = recording.time_s.back() - recording.time_s.front();
  return fmt::format("frames from {:.1f} to {:.1f} s, joints from {:.1f} to {:.1f} s{}", poses.front().time_s,
                     poses.back().time_s, recording.time_s.front(), recording.time_s.back(),
                     joints_s > 100 * frames_s ? ": time_s looks like milliseconds" : "");
}

// The rotation that takes directions to others best (Kabsch 1976), and the mean square that is left.
struct Turned {
  Eigen::Matrix3d rotation;
  double misfit;
};

Turned best_rotation(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) sum += to[i] * from[i].transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double handed = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  const Eigen::Vector3d signs(1, 1, handed);
  return {svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose(),
          2 - 2 * svd.singularValues().dot(signs) / static_cast<double>(from.size())};
}

// By how many times the other sign of a joint has to explain the motion worse, as a mean square.
constexpr double telling_misfit = 9;

// Offset of phi and rotation for one sign of phi.
struct Swing {
  double sign, offset;
  Turned turned;
};

Swing best_swing(const std::vector<TimedPose>& poses, const std::vector<std::array<double, 4>>& joints,
                 const Joints& given, double sign) {
  const auto axes = values_of(poses, &TimedPose::axis);
  std::vector<Eigen::Vector3d> shafts(poses.size());
  double mean = 0;
  for (const auto& at : joints) mean += at[1] / static_cast<double>(joints.size());
  const auto turned_at = [&](double offset) {
    for (std::size_t i = 0; i < joints.size(); ++i) {
      const double theta_rad = given.sign[0] * joints[i][0] + given.offset[0], phi_rad = sign * joints[i][1] + offset;
      shafts[i] = shaft_axis_in_rcm({theta_rad, phi_rad, 0, 0});
    }
    return best_rotation(shafts, axes);
  };
  Swing best{sign, 0, {Eigen::Matrix3d::Identity(), 1e300}};
  const auto consider = [&](double offset) {
    if (const Turned turned = turned_at(offset); turned.misfit < best.turned.misfit) best = {sign, offset, turned};
  };
  // phi and -phi (with theta turned by pi) are the same axis: of both, phi lies between 0 and pi in the mean.
  constexpr int parts = 60;
  for (int i = 1; i < parts; ++i) consider(pi * i / parts - sign * mean);
  for (double step = pi / parts / 2; step > 1e-4; step /= 2)
    for (const double offset : {best.offset - step, best.offset + step}) consider(offset);
  return best;
}

// Turning the RCM frame by pi about its x axis changes the signs of theta and phi, and psi by pi.
void turn_over(Rigid3& camera_from_rcm, Joints& joints) {
  camera_from_rcm.rotation = camera_from_rcm.rotation * Eigen::AngleAxisd(pi, Eigen::Vector3d::UnitX());
  // theta' = -theta - (what keeps its offset the rig's) is a turn about z.
  camera_from_rcm.rotation =
      camera_from_rcm.rotation * Eigen::AngleAxisd(-2 * joints.offset[0], Eigen::Vector3d::UnitZ());
  joints.sign[0] *= -1, joints.sign[1] *= -1;
  joints.offset[1] = pi - joints.offset[1];
}

// psi as the joint's sign makes it agree with the turns seen: direction and length of the mean of exp(i difference).
std::complex<double> mean_turn(const std::vector<TimedPose>& poses, const std::vector<std::array<double, 4>>& joints,
                               const Marker& marker, const ArmGuess& guess, double sign) {
  std::complex<double> sum = 0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const auto q = JointVector::from_vector(q_from_joints(guess.joints, Eigen::Vector4d(joints[i].data())));
    const Rigid3 unturned = camera_from_marker(marker, guess.camera_from_rcm * rcm_from_unrolled(q), 0);
    const double psi_rad = roll_between_rad(unturned.rotation, poses[i].marker.camera_from_marker.rotation);
    sum += std::polar(1.0, psi_rad - sign * joints[i][3]);
  }
  return sum / static_cast<double>(poses.size());
}

// Signs, offsets and rotation by the axes and rolls of poses whose joints are known; `rcm_m`: the intersection of the
// axes. Among equal descriptions it returns that which register_arm() promises.
ArmGuess guess_arm(const Instrument& instrument, const std::vector<TimedPose>& poses,
                   const std::vector<std::array<double, 4>>& joints, const Eigen::Vector3d& rcm_m,
                   double rho_per_joint) {
  ArmGuess guess;
  guess.joints = instrument.joints.value();
  std::array swings{best_swing(poses, joints, guess.joints, 1), best_swing(poses, joints, guess.joints, -1)};
  if (swings[1].turned.misfit < swings[0].turned.misfit) std::swap(swings[0], swings[1]);
  const Swing& swing = swings[0];
  if (swings[1].turned.misfit < telling_misfit * swing.turned.misfit) guess.open_sign = 1;
  guess.misfit_rad = std::sqrt(std::max(0.0, swing.turned.misfit));
  guess.camera_from_rcm = {Eigen::Quaterniond(swing.turned.rotation).normalized(), rcm_m};
  guess.joints.sign[1] = swing.sign, guess.joints.offset[1] = swing.offset;
  if (instrument.camera_from_rcm) {
    ArmGuess over = guess;
    turn_over(over.camera_from_rcm, over.joints);
    const Eigen::Quaterniond& given = instrument.camera_from_rcm->rotation;
    if (given.angularDistance(over.camera_from_rcm.rotation) < given.angularDistance(guess.camera_from_rcm.rotation))
      guess = over;
  }

  constexpr double least_slope = 0.5;
  guess.joints.sign[2] = rho_per_joint < 0 ? -1 : 1;
  if (std::abs(rho_per_joint) < least_slope) guess.open_sign = 2;
  std::vector<double> offsets_m;
  for (std::size_t i = 0; i < poses.size(); ++i)
    offsets_m.push_back((poses[i].origin() - rcm_m).dot(poses[i].axis()) - guess.joints.sign[2] * joints[i][2]);
  guess.joints.offset[2] = median(offsets_m);

  auto turn = mean_turn(poses, joints, instrument.marker, guess, 1);
  auto other = mean_turn(poses, joints, instrument.marker, guess, -1);
  guess.joints.sign[3] = std::abs(turn) > std::abs(other) ? 1 : -1;
  if (guess.joints.sign[3] < 0) std::swap(turn, other);
  if (1 - std::abs(other) < telling_misfit * (1 - std::abs(turn))) guess.open_sign = 3;
  // As the rig has it, but for what a rig may not hold.
  const double before_rad = instrument.joints->offset[3],
               offset_rad = before_rad + wrap_pi(std::arg(turn) - before_rad);
  guess.joints.offset[3] = std::abs(offset_rad) < two_pi ? offset_rad : wrap_pi(offset_rad);
  return guess;
}

}  // namespace

std::string too_few_poses(std::size_t poses) {
  return fmt::format("the marker was found in {} frames, at least {} are needed", poses, min_registration_poses);
}

std::string ambiguous_delay(const ArmStart& start) {
  return fmt::format(
      "the motion repeats: at a delay of {:.2f} s the joints explain it about as well as at {:.2f} s: swing "
      "irregularly, or cut both recordings to less than a period",
      start.other_delays_s.front(), start.delay_s);
}

ArmStart start_arm(const Instrument& instrument, const std::vector<TimedPose>& poses, const JointRecording& recording,
                   const std::string& source) {
  ArmStart start;
  if (poses.size() < min_registration_poses) return start.refusal = too_few_poses(poses.size()), start;
  const double about_s = instrument.image_delay_s.value_or(0);
  refuse_apart(poses, recording, about_s, source);
  const Joints& joints = instrument.joints.value();
  if (const std::string still = still_joints(joints, ranges_of(recording.joints)); !still.empty())
    return start.refusal = still + ": " + swing_more, start;
  const auto meeting = axes_meeting_point(poses);
  if (!meeting)
    return start.refusal = std::string("the shaft's axes are too alike to locate their intersection: ") + swing_more,
           start;
  const auto rho_m = values_of(poses, [&](const TimedPose& pose) { return pose.beyond_m(meeting->point_m); });
  if (median(std::vector(rho_m)) < 0) return start.refusal = reversed_marker, start;

  constexpr double least_explained = 0.5, max_misfit_rad = 0.1;
  const auto foreign = [&](const std::string& how) {
    start.refusal = fmt::format(
        "the joints do not move as the marker does ({}): is it this arm's recording, are names in the order theta, "
        "phi, rho, psi, do both clocks run within 30 s of each other ({})",
        how, clocks_text(poses, recording));
    return start;
  };
  std::vector<DelayMatch> matches = search_delay(poses, rho_m, recording, about_s);
  if (matches.empty() || matches.front().explained < least_explained)
    return foreign(
        fmt::format("{:.0f} % of the motion is explained", matches.empty() ? 0 : 100 * matches.front().explained));
  std::stable_partition(matches.begin(), matches.end(),
                        [&](const DelayMatch& match) { return std::abs(match.delay_s - about_s) <= usual_delay_s; });
  const DelayMatch& match = matches.front();
  start.delay_s = match.delay_s;
  for (auto other = matches.begin() + 1; other != matches.end(); ++other)
    start.other_delays_s.push_back(other->delay_s);
  if (!start.other_delays_s.empty() && std::abs(start.delay_s - about_s) > usual_delay_s)
    return start.refusal = ambiguous_delay(start), start;
  keep_common(poses, recording, start);
  if (start.poses.size() < min_registration_poses)
    return start.refusal = fmt::format("{} frames lie within the recording of the joints, at least {} are needed",
                                       start.poses.size(), min_registration_poses),
           start;
  start.ranges = ranges_of(start.joints);
  if (const std::string still = still_joints(joints, start.ranges); !still.empty())
    return start.refusal = "while the marker is seen, " + still + ": " + swing_more, start;
  start.guess = guess_arm(instrument, start.poses, start.joints, meeting->point_m, match.rho_per_joint);
  if (start.guess.misfit_rad > max_misfit_rad)
    return foreign(fmt::format("axes miss by {:.2f} rad", start.guess.misfit_rad));
  if (const auto open = start.guess.open_sign)
    return start.refusal = fmt::format("both signs of {} explain the motion ({}): move it independently of the others",
                                       joints.names[*open], travels_text(joints, start.ranges)),
           start;
  return start;
}

}  // namespace lapservo::internal
