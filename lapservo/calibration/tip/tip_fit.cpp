#include "lapservo/calibration/tip/tip_fit.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "lapservo/calibration/marker/frame_fit.h"
#include "lapservo/calibration/tip/tool_place.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/rotation.h"

namespace lapservo::internal {
namespace {

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
  std::vector<double> scales, tilts_rad, rolls_rad;
  for (const TipSighting& sighting : sightings) {
    const auto& seen = sighting.pose.marker;
    scales.push_back(seen.sigma_z_m / sighting.pose.origin().norm());
    tilts_rad.push_back(seen.sigma_axis_rad / std::sqrt(2.0)), rolls_rad.push_back(seen.sigma_roll_rad);
  }
  std::vector<Unknown> unknowns;
  for (auto* sigmas : {&scales, &tilts_rad, &rolls_rad})
    unknowns.push_back({0, step_rad, common_fraction * median(*sigmas)});
  return unknowns;
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

class TipModel {
 public:
  TipModel(const Tool& tool, const std::vector<TipSighting>& sightings, const TipWay& way, double azimuth_rad)
      : tool_(tool), sightings_(sightings), is_bent_(is_bent_differently(sightings)) {
    const Eigen::Matrix<double, 6, 1> start_m = start();
    for (const TipSighting& sighting : sightings)
      in_sigmas_.push_back(in_sigmas(sighting.pose, start_m.head<3>(), way.sigma_point_m));
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
    for (const TipFault& fault : way.faults)
      for (const Eigen::Matrix3Xd& moves : fault.moves) moves_.push_back(&moves);
    faults_ = add_block(unknowns_, std::vector<Unknown>(moves_.size(), {0, step_m}));
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
    for (Eigen::Index k = faults_.first; k < x.size(); ++k)
      if (x[k] != 0)
        point_m += x[k] * moves_[static_cast<std::size_t>(k - faults_.first)]->col(static_cast<Eigen::Index>(i));
    return (1 + common[0]) * sighting.pose.origin() + turn * arm_m - point_m;
  }

  Tool tool_at(const Eigen::VectorXd& x, const Eigen::MatrixXd& covariance) const {
    const Eigen::MatrixXd of_place = place_.of(covariance);
    if (!is_bent_) return placed_by_tip(tool_, sightings_.front().wrist_rad, x.head<3>(), of_place);
    Tool tool = bent(x);
    tool.place->covariance.topLeftCorner(place_.size, place_.size) = of_place;
    return tool;
  }

 private:
  Tool bent(const Eigen::VectorXd& x) const {
    Tool tool = tool_;
    tool.place = Tool::Place{x.head<3>(), wrap_pi(x[3])};
    for (std::size_t i = 0; i < tool.wrist.size(); ++i) tool.wrist[i].offset_rad = x[4 + static_cast<Eigen::Index>(i)];
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
  bool is_bent_;
  std::vector<Eigen::Matrix3d> in_sigmas_;
  std::vector<const Eigen::Matrix3Xd*> moves_;  // of the faults' components
  std::vector<Unknown> unknowns_;
  Block place_, common_, dimple_, faults_;
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

// The fault that leaves least of a misfit.
Explanation explaining_fault(const Tool& tool, const std::vector<TipSighting>& sightings, const TipWay& way,
                             const FrameFit& without) {
  constexpr double least_gain = 0.9;
  Explanation best{least_gain * left_by(without)};
  for (const TipFault& fault : way.faults) {
    TipWay with = way;
    with.faults = {fault};
    const auto fitted = best_fit(tool, sightings, with, true);
    if (!fitted || left_by(fitted->fit) > best.left) continue;
    const double size_m = fitted->model.faults().of(fitted->fit.x).norm();
    best = {left_by(fitted->fit), size_m, fmt::format("{} by {:.2g} mm: {}", fault.what, 1e3 * size_m, fault.remedy)};
  }
  return best;
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

}  // namespace

TipCalibration fit_tip(const Tool& tool, const std::vector<TipSighting>& sightings, const TipWay& way) {
  TipCalibration result;
  const auto best = best_fit(tool, sightings, way, false);
  if (!best) return result.refusal = "the tip is left open: " + way.to_do, result;
  const auto& [model, fit] = *best;
  const double unmodelled = way.unmodelled_sigmas * way.unmodelled_sigmas;
  result.tool = model.tool_at(fit.x, covariance_at_least(unmodelled * fit.covariance, fit.independent) +
                                         fit.departures.by_seen + fit.departures.by_instead);
  result.with_offsets = model.is_bent();
  result.noise = fit.scales.maxCoeff();
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    result.misses_m.push_back(model.miss_m(fit.x, i).norm());
    const auto tip = tip_in_marker(result.tool, sightings[i].wrist_rad);
    result.sigma_m =
        std::max(result.sigma_m, std::sqrt(eigenvalues_of_symmetric(tip.of_place.topLeftCorner<3, 3>())[2]));
  }
  Explanation fault{0};
  if (!fit.departures.seen.empty() || is_misfit(result)) fault = explaining_fault(tool, sightings, way, fit);
  if (fault.size_m > least_fault_m) result.fault = fault.text;
  result.refusal = refusal_of(result, way, fault.size_m);
  return result;
}

}  // namespace lapservo::internal
