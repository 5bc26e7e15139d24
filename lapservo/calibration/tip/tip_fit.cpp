#include "lapservo/calibration/tip/tip_fit.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "lapservo/calibration/marker/frame_fit.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/tool/wrist.h"

namespace lapservo::internal {
namespace {

// Something that a fit leaves out: it moves the points, camera frame, or the tip in the frame of the last joint.
struct TipFault {
  std::string what, remedy;
  std::vector<Eigen::Matrix3Xd> moves;  // a matrix a component, of a size of 1 m at the tip; a column a sighting
  bool is_of_tip = false;               // instead: three components, for a wrist that is bent differently
  double prior_m = 0;                   // standard deviation of a component's size beforehand; 0: nothing is known
};

// One way to measure a tip, beside its sightings.
struct TipWay {
  std::vector<TipFault> faults;
  std::optional<TipFault> wander;   // of the points: slow, of no cause
  std::optional<TipFault> other;    // beside `faults`, where the points miss by far
  double sigma_point_m = 0;         // of each point by itself
  double unmodelled_sigmas = 1;     // times what scatters, see frame_fit.h
  std::size_t alike_sightings = 1;  // over so many errors are alike
  std::string to_mend, to_do;       // against a misfit that nothing explains, and for a tip that is left open
};

// A tip that is known worse is not written, nor one by data that depart from their model by more.
constexpr double max_sigma_m = 0.5e-3, max_misfit_m = 0.3e-3, max_azimuth_sigma_rad = 0.1;
// In the sightings' own sigmas; poses of compressed video alone miss by half a millimetre.
constexpr double max_noise = 2;
constexpr double least_fault_m = 0.05e-3;  // smaller ones are not worth a word
constexpr double bent_differently_rad = 0.2;
constexpr double step_m = 1e-5, step_rad = 1e-4;

// Errors that all poses share: the scale of distances, the axis' tilt along the view, the turn about it.
std::vector<Unknown> common_errors(const std::vector<TipSighting>& sightings) {
  constexpr double common_fraction = 0.5;
  const auto unknown = [&](auto sigma_of) -> Unknown {
    return {0, step_rad, common_fraction * median(values_of(sightings, sigma_of))};
  };
  return {unknown([](const TipSighting& s) { return s.pose.marker.sigma_z_m / s.pose.origin().norm(); }),
          unknown([](const TipSighting& s) { return s.pose.marker.sigma_axis_rad / std::sqrt(2.0); }),
          unknown([](const TipSighting& s) { return s.pose.marker.sigma_roll_rad; })};
}

// Across the axis and the view: about it an axis tilts along the view.
Eigen::Vector3d hinge_of(const TimedPose& pose) {
  return pose.axis().cross(pose.origin() + 1e-9 * pose.axis().unitOrthogonal()).normalized();
}

// Turns a miss into one along the shaft in the image, across it and along the view, each in its standard deviations.
Eigen::Matrix3d in_sigmas(const TimedPose& pose, const Eigen::Vector3d& tip_in_marker_m, double sigma_point_m) {
  const Observation::MarkerPose& seen = pose.marker;
  const Eigen::Vector3d axis = pose.axis(), hinge = hinge_of(pose), ray = pose.origin().normalized();
  const Eigen::Vector3d arm_m = seen.camera_from_marker.rotation * tip_in_marker_m;
  const double tilt_rad = seen.sigma_axis_rad / std::sqrt(2.0);
  Eigen::Matrix3d directions, by_turns;
  directions << ray.cross(hinge), hinge, ray;
  by_turns << tilt_rad * hinge.cross(arm_m), tilt_rad * hinge.cross(axis).cross(arm_m),
      seen.sigma_roll_rad * axis.cross(arm_m);
  const Eigen::Vector3d by_place(seen.sigma_xy_m, seen.sigma_xy_m, seen.sigma_z_m);
  const Eigen::Vector3d variances = (directions.transpose() * by_turns).rowwise().squaredNorm() + by_place.cwiseAbs2() +
                                    Eigen::Vector3d::Constant(sigma_point_m * sigma_point_m);
  return variances.cwiseSqrt().cwiseInverse().asDiagonal() * directions.transpose();
}

bool is_bent_differently(const std::vector<TipSighting>& sightings) {
  for (std::size_t joint = 0; joint < sightings.front().wrist_rad.size(); ++joint) {
    const auto [low, high] =
        std::ranges::minmax_element(sightings, {}, [=](const TipSighting& seen) { return seen.wrist_rad[joint]; });
    if (high->wrist_rad[joint] - low->wrist_rad[joint] > bent_differently_rad) return true;
  }
  return false;
}

// The mean of each joint.
std::vector<double> mean_reading(const std::vector<TipSighting>& sightings) {
  std::vector<double> mean_rad(sightings.front().wrist_rad.size(), 0.0);
  for (const TipSighting& sighting : sightings)
    for (std::size_t joint = 0; joint < mean_rad.size(); ++joint)
      mean_rad[joint] += sighting.wrist_rad[joint] / static_cast<double>(sightings.size());
  return mean_rad;
}

// How far a wrist has its tip from where other readings have it; whatever its place.
double moved_m(Tool tool, const std::vector<double>& from_rad, const std::vector<double>& to_rad) {
  tool.place.emplace();
  const auto tip_at = [&](const std::vector<double>& wrist_rad) {
    return tip_in_marker(tool, wrist_rad).marker_from_tip.translation;
  };
  return (tip_at(to_rad) - tip_at(from_rad)).norm();
}

// A wrist that is bent alike in all sightings counts as rigid at the mean of its readings: what they differ by is noise
// of the points.
class TipModel {
 public:
  TipModel(const Tool& tool, const std::vector<TipSighting>& sightings, const TipWay& way, double azimuth_rad)
      : tool_(tool),
        sightings_(sightings),
        mean_rad_(mean_reading(sightings)),
        is_bent_(is_bent_differently(sightings)) {
    const Eigen::Matrix<double, 6, 1> start_m = start();
    for (const TipSighting& sighting : sightings) {
      const double off_m = is_bent_ ? 0 : moved_m(tool, mean_rad_, sighting.wrist_rad);
      in_sigmas_.push_back(in_sigmas(sighting.pose, start_m.head<3>(), std::hypot(way.sigma_point_m, off_m)));
    }
    std::vector<Unknown> place;
    for (Eigen::Index i = 0; i < 3; ++i) place.push_back({start_m[i], step_m});
    if (is_bent_) {
      place[0] = place[1] = {0, step_m, off_axis_sigma_m};
      place.push_back({azimuth_rad, step_rad});
      for (const WristJoint& joint : tool.wrist) place.push_back({0, step_rad, joint.sigma_reading_rad});
    }
    place_ = add_block(unknowns_, place);
    common_ = add_block(unknowns_, common_errors(sightings));
    if (!sightings.front().point_in_camera_m)
      dimple_ = add_block(unknowns_, {{start_m[3], step_m}, {start_m[4], step_m}, {start_m[5], step_m}});
    std::vector<Unknown> sizes;
    for (const TipFault& fault : way.faults)
      for (const Eigen::Matrix3Xd& moves : fault.moves)
        moves_.push_back(&moves), sizes.push_back({0, step_m, fault.prior_m});
    faults_ = add_block(unknowns_, sizes);
    if (std::ranges::any_of(way.faults, &TipFault::is_of_tip) && is_bent_) {
      tip_ = add_block(unknowns_, std::vector<Unknown>(3, {0, step_m}));
      faults_.size += 3;
    }
  }

  const std::vector<Unknown>& unknowns() const { return unknowns_; }
  const Block& faults() const { return faults_; }
  bool is_bent() const { return is_bent_; }

  // A column each sighting; one row, where they are too few for a scale of each direction.
  Eigen::MatrixXd residuals(const Eigen::VectorXd& x) const {
    constexpr std::size_t few = 40;
    Eigen::MatrixXd all(3, static_cast<Eigen::Index>(sightings_.size()));
    for (std::size_t i = 0; i < sightings_.size(); ++i)
      all.col(static_cast<Eigen::Index>(i)) = in_sigmas_[i] * miss_m(x, i);
    return sightings_.size() < few ? all.reshaped(1, all.size()).eval() : all;
  }

  // x without the faults stands for 0 of each.
  Eigen::Vector3d miss_m(const Eigen::VectorXd& x, std::size_t i) const {
    const TipSighting& sighting = sightings_[i];
    const Eigen::Vector3d common = common_.of(x),
                          arm_m = sighting.pose.marker.camera_from_marker.rotation * tip_m(x, sighting.wrist_rad);
    const Eigen::Quaterniond turn = rotation_by(common[1] * hinge_of(sighting.pose) + common[2] * sighting.pose.axis());
    Eigen::Vector3d point_m = dimple_.size > 0 ? Eigen::Vector3d(dimple_.of(x)) : *sighting.point_in_camera_m;
    const Eigen::Index moves_end = faults_.first + static_cast<Eigen::Index>(moves_.size());
    for (Eigen::Index k = faults_.first; k < std::min(moves_end, x.size()); ++k)
      if (x[k] != 0)
        point_m += x[k] * moves_[static_cast<std::size_t>(k - faults_.first)]->col(static_cast<Eigen::Index>(i));
    return (1 + common[0]) * sighting.pose.origin() + turn * arm_m - point_m;
  }

  Tool tool_at(const Eigen::VectorXd& x, const Eigen::MatrixXd& covariance) const {
    const Eigen::MatrixXd of_place = place_.of(covariance);
    if (!is_bent_) return placed_by_tip(tool_, mean_rad_, x.head<3>(), of_place);
    Tool tool = bent(x);
    tool.place->covariance.topLeftCorner(place_.size, place_.size) = of_place;
    return tool;
  }

 private:
  Tool bent(const Eigen::VectorXd& x) const {
    Tool tool = tool_;
    tool.place = Tool::Place{x.head<3>(), wrap_pi(x[3])};
    for (std::size_t i = 0; i < tool.wrist.size(); ++i) tool.wrist[i].offset_rad = x[4 + static_cast<Eigen::Index>(i)];
    if (tip_.size > 0 && x.size() > tip_.first) tool.last_from_tip.translation += tip_.of(x);
    return tool;
  }

  Eigen::Vector3d tip_m(const Eigen::VectorXd& x, const std::vector<double>& wrist_rad) const {
    if (!is_bent_) return x.head<3>();
    return tip_in_marker(bent(x), wrist_rad).marker_from_tip.translation;
  }

  // Tip and dimple by R tip - dimple = -origin, all sightings alike.
  Eigen::Matrix<double, 6, 1> start() const {
    Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> sum = Eigen::Matrix<double, 6, 1>::Zero();
    for (const TipSighting& sighting : sightings_) {
      Eigen::Matrix<double, 3, 6> slopes;
      slopes << sighting.pose.marker.camera_from_marker.rotation.toRotationMatrix(), -Eigen::Matrix3d::Identity();
      if (sighting.point_in_camera_m) slopes.rightCols<3>().setZero();
      information += slopes.transpose() * slopes;
      sum +=
          slopes.transpose() * (sighting.point_in_camera_m.value_or(Eigen::Vector3d::Zero()) - sighting.pose.origin());
    }
    return solve_symmetric(information, sum);
  }

  const Tool& tool_;
  const std::vector<TipSighting>& sightings_;
  std::vector<double> mean_rad_;
  bool is_bent_;
  std::vector<Eigen::Matrix3d> in_sigmas_;
  std::vector<const Eigen::Matrix3Xd*> moves_;  // of the faults' components
  std::vector<Unknown> unknowns_;
  Block place_, common_, dimple_, faults_, tip_;  // tip_: the last of the faults
};

struct ModelFit {
  TipModel model;
  FrameFit fit;
};

// The cost of residuals, of which those of outliers hardly count.
double left_by(const FrameFit& fit) {
  return fit.residuals.array().square().log1p().sum();
}

// From all sides, where the azimuth is open. The way's faults are held, unless they are fitted, too.
std::optional<ModelFit> best_fit(const Tool& tool, const std::vector<TipSighting>& sightings, const TipWay& way,
                                 bool with_faults) {
  const int starts = is_bent_differently(sightings) ? 8 : 1;
  std::optional<ModelFit> best;
  for (int k = 0; k < starts; ++k) {
    TipModel model(tool, sightings, way, two_pi * k / starts);
    auto fit = fit_frames([&](const Eigen::VectorXd& x) { return model.residuals(x); }, model.unknowns(),
                          way.alike_sightings, {}, with_faults ? 0 : static_cast<std::size_t>(model.faults().size));
    if (fit && (!best || left_by(*fit) < left_by(best->fit))) best.emplace(ModelFit{std::move(model), std::move(*fit)});
  }
  return best;
}

struct Explanation {
  double left, size_m = 0;
  std::string text{};
};

std::string text_of(const TipFault& fault, double size_m) {
  return fmt::format("{} by {:.2g} mm: {}", fault.what, 1e3 * size_m, fault.remedy);
}

// The fault that leaves least of a misfit.
Explanation explaining_fault(const Tool& tool, const std::vector<TipSighting>& sightings, const TipWay& way,
                             const FrameFit& without, bool miss_by_far) {
  constexpr double least_gain = 0.9;
  Explanation best{least_gain * left_by(without)};
  std::vector<TipFault> faults = way.faults;
  if (miss_by_far && way.other) faults.push_back(*way.other);
  for (const TipFault& fault : faults) {
    TipWay with = way;
    with.faults = {fault};
    const auto fitted = best_fit(tool, sightings, with, true);
    if (!fitted || fitted->model.faults().size == 0 || left_by(fitted->fit) > best.left) continue;
    const Eigen::VectorXd sizes_m = fitted->model.faults().of(fitted->fit.x);
    std::string tip_key;
    if (fault.is_of_tip) {
      const Eigen::Vector3d tip_m = (1e4 * (tool.last_from_tip.translation + sizes_m)).array().round() / 1e4 + 0.0;
      tip_key = fmt::format(" tip_in_last_joint_m: [{:g}, {:g}, {:g}]", tip_m.x(), tip_m.y(), tip_m.z());
    }
    best = {left_by(fitted->fit), sizes_m.norm(), text_of(fault, sizes_m.norm()) + tip_key};
  }
  return best;
}

struct WanderingFit {
  FrameFit fit;
  double wander_m;  // rms of a component
};

// Beside points that wander as far as the residuals say (MacKay 1992): what goes with the motion as slowly as a wander
// does, the tip is known that much worse by. Nullopt where they say no more than least_fault_m.
std::optional<WanderingFit> wandering_fit(const Tool& tool, const std::vector<TipSighting>& sightings, TipWay way) {
  constexpr double settled = 0.2;
  constexpr int rounds = 4;
  if (!way.wander) return std::nullopt;
  way.faults = {*way.wander};
  double& prior_m = way.faults.front().prior_m = least_fault_m;
  for (int round = 1;; ++round) {
    auto fitted = best_fit(tool, sightings, way, true);
    if (!fitted) return std::nullopt;
    const Block& sizes = fitted->model.faults();
    const double known = (1 - sizes.of(fitted->fit.independent).diagonal().array() / (prior_m * prior_m)).sum();
    const double next_m = sizes.of(fitted->fit.x).norm() / std::sqrt(std::max(known, 1e-9));
    if (next_m < least_fault_m) return std::nullopt;
    if (round == rounds || std::abs(next_m - prior_m) < settled * prior_m)
      return WanderingFit{std::move(fitted->fit), next_m};
    prior_m = next_m;
  }
}

bool is_misfit(const TipCalibration& result) {
  return rms(result.misses_m) > max_misfit_m && result.noise > max_noise;
}

// Empty where the tip is known. `fault_m`: the size of the fault.
std::string refusal_of(const TipCalibration& result, const TipWay& way, double fault_m) {
  const bool is_open = result.sigma_m > max_sigma_m;
  if (!result.fault.empty() && (fault_m > max_misfit_m || is_misfit(result) || is_open)) return result.fault;
  if (is_misfit(result))
    return fmt::format("the tip misses its point by {:.2g} mm rms, {:.1f} times what images and hand leave: {}",
                       1e3 * rms(result.misses_m), result.noise, way.to_mend);
  if (is_open) return fmt::format("the tip would be known to {:.2g} mm only: {}", 1e3 * result.sigma_m, way.to_do);
  if (const double sigma_rad = std::sqrt(result.tool.place->covariance(3, 3));
      result.with_offsets && sigma_rad > max_azimuth_sigma_rad)
    return fmt::format(
        "the azimuth of the wrist would be known to {:.0f} degrees only: bend each of its joints by 30 "
        "degrees or more in some of the touches",
        deg_from_rad(sigma_rad));
  return {};
}

// The place of a tool whose tip was at points (Ceres, Cauchy loss). Half of a pose's error is common to all. A wrist
// that is bent differently in the sightings shows its azimuth and its joints' offsets, which the tool's own sigmas
// bound. Refused where the tip is left open, or misses its points by more than a tip may be off.
TipCalibration fit_tip(const Tool& tool, const std::vector<TipSighting>& sightings, const TipWay& way) {
  TipCalibration result;
  const auto best = best_fit(tool, sightings, way, false);
  if (!best) return result.refusal = "the tip is left open: " + way.to_do, result;
  const auto& [model, fit] = *best;
  const double unmodelled = way.unmodelled_sigmas * way.unmodelled_sigmas;
  const auto wandering = wandering_fit(tool, sightings, way);
  const FrameFit& beside = wandering ? wandering->fit : fit;
  result.tool = model.tool_at(beside.x, covariance_at_least(unmodelled * beside.covariance, beside.independent) +
                                            beside.departures.by_seen + beside.departures.by_instead);
  result.with_offsets = model.is_bent();
  result.noise = fit.scales.maxCoeff();
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    result.misses_m.push_back(model.miss_m(fit.x, i).norm());
    const auto tip = tip_in_marker(result.tool, sightings[i].wrist_rad);
    result.sigma_m =
        std::max(result.sigma_m, std::sqrt(eigenvalues_of_symmetric(tip.of_place.topLeftCorner<3, 3>())[2]));
  }
  Explanation fault{0};
  if (!fit.departures.seen.empty() || is_misfit(result))
    fault = explaining_fault(tool, sightings, way, fit, is_misfit(result));
  if (wandering && !(fault.size_m > least_fault_m))
    fault = {0, wandering->wander_m, text_of(*way.wander, wandering->wander_m)};
  if (fault.size_m > least_fault_m) result.fault = fault.text;
  result.refusal = refusal_of(result, way, fault.size_m);
  return result;
}

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

// A place of its own at the end of each part of the recording, linear between.
TipFault wander_of(const std::vector<TimedPose>& poses) {
  TipFault wander{"the tip wanders in its dimple", "use a deeper dimple, press the tip into it, and record again", {}};
  for (int k = 0; k <= times; ++k)
    for (Eigen::Index i = 0; i < 3; ++i)
      wander.moves.push_back(moves_of(poses, [&](const TimedPose&, double part) -> Eigen::Vector3d {
        return std::max(0.0, 1 - std::abs(times * part - k)) * Eigen::Vector3d::Unit(i);
      }));
  return wander;
}

constexpr double touch_sigma_m = 0.1e-3;
constexpr std::size_t least_touches = 5;

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

const TipFault other_point{"the point that touched lies elsewhere on the last joint than the tip,",
                           "touch with the tip, or give the rig's tool, if its jaw ends there,",
                           {},
                           true};

// Azimuth and offsets stay; without a place any azimuth is possible, and offsets are as large as the readings' sigmas.
Tool::Place place_before(const Tool& tool) {
  if (tool.place) return *tool.place;
  Tool::Place place;
  if (tool.wrist.empty()) return place;
  const double any_azimuth_rad = std::numbers::pi / std::sqrt(3.0);
  place.covariance(3, 3) = any_azimuth_rad * any_azimuth_rad;
  for (std::size_t i = 0; i < tool.wrist.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(4 + i);
    place.covariance(k, k) = std::pow(tool.wrist[i].sigma_reading_rad, 2);
  }
  return place;
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
    result = fit_tip(
        tool, sightings,
        {possible_faults(poses), wander_of(poses), std::nullopt, 0, usual_unmodelled_sigmas, poses_per_second(poses),
         "is it in its dimple all the time, is the wrist held straight, does anything else move", to_do});
  }
  return result;
}

TipCalibration pivoted_tip(const Tool& tool, const std::vector<TipSighting>& sightings) {
  TipCalibration result;
  if (sightings.empty())
    return result.refusal = "no frame with the marker has readings of the wrist's joints: record both at once", result;
  const std::vector<double> mean_rad = mean_reading(sightings);
  std::vector<TimedPose> poses;
  for (const TipSighting& sighting : sightings) {
    poses.push_back(sighting.pose);
    for (std::size_t i = 0; i < mean_rad.size(); ++i)
      if (std::abs(sighting.wrist_rad[i] - mean_rad[i]) > tool.wrist[i].sigma_reading_rad)
        return result.refusal =
                   fmt::format("{} is at {:.3f} rad at {:.1f} s, but at {:.3f} rad on average: {}", tool.wrist[i].name,
                               sighting.wrist_rad[i], sighting.pose.time_s, mean_rad[i], hold_wrist),
               result;
  }
  return pivoted_tip(tool, mean_rad, poses);
}

TipCalibration touched_tip(const Tool& tool, const std::vector<TipSighting>& touches,
                           const std::vector<std::string>& names) {
  constexpr double outlying = 8, least_outlying_m = 0.5e-3;
  TipCalibration result;
  if (touches.size() < least_touches)
    return result.refusal = fmt::format("{} touches show the marker, {} are needed", touches.size(), least_touches),
           result;
  result = fit_tip(tool, touches,
                   {possible_faults(touches), std::nullopt, other_point, touch_sigma_m, 1, 1,
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

Tool placed_by_tip(Tool tool, const std::vector<double>& wrist_rad, const Eigen::Vector3d& tip_in_marker_m,
                   const Eigen::Matrix3d& covariance_m2) {
  Tool::Place place = place_before(tool);
  place.base_in_marker_m.setZero();
  tool.place = place;
  place.base_in_marker_m = tip_in_marker_m - tip_in_marker(tool, wrist_rad).marker_from_tip.translation;
  const auto slopes = tip_slopes(tool, wrist_rad).topRightCorner<3, 5>().eval();
  const Eigen::Matrix<double, 5, 5> rest = place.covariance.bottomRightCorner<5, 5>();
  place.covariance.topLeftCorner<3, 3>() = covariance_m2 + slopes * rest * slopes.transpose();
  place.covariance.topRightCorner<3, 5>() = -slopes * rest;
  place.covariance.bottomLeftCorner<5, 3>() = place.covariance.topRightCorner<3, 5>().transpose();
  tool.place = place;
  return tool;
}

Tool placed_by_calliper(Tool tool, const Marker& marker, double distance_m, double sigma_m) {
  Tool::Place place = place_before(tool);
  double length_m2 = 0;  // the variance of the marker's: between its ends, or of its bands
  if (marker.sigmas.bands_upper_m)
    for (const double sigma : *marker.sigmas.bands_upper_m) length_m2 += sigma * sigma;
  length_m2 = std::max(length_m2, 2 * marker.tolerance_m * marker.tolerance_m);
  const double across_m2 = off_axis_sigma_m * off_axis_sigma_m;
  place.base_in_marker_m = {0, 0, marker.length_m() + distance_m};
  place.covariance.topRows<3>().setZero(), place.covariance.leftCols<3>().setZero();
  place.covariance.diagonal().head<3>() << across_m2, across_m2, sigma_m * sigma_m + length_m2;
  tool.place = place;
  return tool;
}

}  // namespace lapservo::internal
