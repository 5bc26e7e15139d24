#include "lapservo/calibration/registration/arm_fit.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>

#include "lapservo/calibration/recording/joint_recording.h"
#include "lapservo/calibration/registration/timed_pose.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/error.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/joint_conversion.h"

namespace lapservo::internal {

ArmModel::ArmModel(const Instrument& instrument, const ArmStart& start, const JointRecording& recording,
                   const ArmFaults& faults)
    : marker_(instrument.marker),
      poses_(start.poses),
      recording_(refined(recording, 5e-3)),
      guess_(start.guess),
      faults_(faults.joints) {
  constexpr std::array<double, 4> least_travel{0.05, 0.05, 5e-3, 0.05};
  for (std::size_t j = 0; j < 4; ++j) {
    const auto [low, high] = std::ranges::minmax_element(recording.joints, {}, [=](const auto& at) { return at[j]; });
    if ((*high)[j] - (*low)[j] > least_travel[j]) moving_.push_back(j);
    middle_[j] = (start.ranges.low[j] + start.ranges.high[j]) / 2;
  }
  const auto q = JointVector::from_vector(q_from_joints(guess_.joints, Eigen::Vector4d(middle_.data())));
  rcm_from_middle_ = rcm_from_unrolled(q).rotation;
  add_unknowns(start.delay_s, faults);
}

void ArmModel::add_unknowns(double delay_s, const ArmFaults& faults) {
  // Compressed video moves the outline by some hundredths of a pixel, and the foreshortened length by more.
  constexpr double scale_prior = 2e-3, tilt_prior_rad = 5e-3;
  // So that what a recording leaves open does not stop the fit: farther off, nothing would have been found.
  constexpr double drift_prior_m = 0.05, drift_prior_rad = 0.5;
  constexpr double step_rad = 1e-4, step_m = 1e-5, step_s = 1e-3, step = 1e-4;
  const auto add = [&](const std::vector<Unknown>& added) { return add_block(unknowns_, added); };
  const auto& offset = guess_.joints.offset;
  const Eigen::Vector3d& rcm_m = guess_.camera_from_rcm.translation;
  blocks_.rotation = add(std::vector<Unknown>(3, {0, step_rad}));
  blocks_.translation = add({{rcm_m.x(), step_m}, {rcm_m.y(), step_m}, {rcm_m.z(), step_m}});
  blocks_.offsets = add({{offset[1], step_rad}, {offset[2], step_m}, {offset[3], step_rad}});
  blocks_.delay = add({{delay_s, step_s}});
  blocks_.scale = add({{0, step, scale_prior}});
  blocks_.tilt = add({{0, step_rad, tilt_prior_rad}});
  std::vector<Unknown> backlash;
  for (const std::size_t joint : moving_) backlash.push_back({0, joint == 2 ? step_m : step_rad});
  blocks_.backlash = add(backlash);
  if (faults.drift) {
    std::vector<Unknown> drift(3, {0, step_m, drift_prior_m});
    drift.insert(drift.end(), 3, {0, step_rad, drift_prior_rad});
    blocks_.drift = add(drift);
  }
  std::vector<Unknown> joints;
  for (const JointFault& fault : faults.joints) joints.push_back({0, fault.step, fault.prior});
  blocks_.joints = add(joints);
}

Rigid3 ArmModel::camera_from_rcm(const Eigen::VectorXd& x) const {
  const Eigen::Vector3d turn = blocks_.rotation.of(x);
  return {(guess_.camera_from_rcm.rotation * rotation_by(turn)).normalized(), blocks_.translation.of(x)};
}

Rigid3 ArmModel::camera_from_rcm_at(const Eigen::VectorXd& x, double time_s, const std::array<double, 4>& at) const {
  Rigid3 camera_from_rcm = this->camera_from_rcm(x);
  Eigen::Vector3d given_m = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < faults_.size(); ++k)
    if (const auto j = faults_[k].gives_with)
      given_m[faults_[k].along] += blocks_.joints.of(x)[static_cast<Eigen::Index>(k)] * (at[*j] - middle_[*j]);
  camera_from_rcm.translation += camera_from_rcm.rotation * (rcm_from_middle_ * given_m);
  if (blocks_.drift.size == 0) return camera_from_rcm;
  const double first_s = poses_.front().time_s, span_s = std::max(1e-9, poses_.back().time_s - first_s);
  const double part = (time_s - first_s) / span_s - 0.5;
  camera_from_rcm.translation += part * blocks_.drift.of(x).head<3>();
  const Eigen::Vector3d turn = part * blocks_.drift.of(x).tail<3>();
  camera_from_rcm.rotation = camera_from_rcm.rotation * rotation_by(turn);
  return camera_from_rcm;
}

Joints ArmModel::joints(const Eigen::VectorXd& x) const {
  Joints joints = guess_.joints;
  for (Eigen::Index i = 0; i < 3; ++i) joints.offset[static_cast<std::size_t>(i) + 1] = blocks_.offsets.of(x)[i];
  return joints;
}

std::array<double, 4> ArmModel::backlash_of(const Eigen::VectorXd& x) const {
  std::array<double, 4> widths{};
  for (std::size_t k = 0; k < moving_.size(); ++k)
    widths[moving_[k]] = blocks_.backlash.of(x)[static_cast<Eigen::Index>(k)];
  return widths;
}

Eigen::MatrixXd ArmModel::residuals(const Eigen::VectorXd& x) const {
  const Joints joints = this->joints(x);
  const JointRecording instrument = behind_backlash(x);
  const double delay_s = blocks_.delay.of(x)[0];
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(6, static_cast<Eigen::Index>(poses_.size()));
  for (std::size_t i = 0; i < poses_.size(); ++i) {
    const double time_s = std::clamp(poses_[i].time_s - delay_s, instrument.time_s.front(), instrument.time_s.back());
    const auto at = instrument.at(time_s);
    if (!at) continue;
    const auto q = JointVector::from_vector(q_from_joints(joints, Eigen::Vector4d(at->data())));
    all.col(static_cast<Eigen::Index>(i)) = difference(poses_[i], camera_from_rcm_at(x, poses_[i].time_s, *at), q, x);
  }
  return all;
}

JointRecording ArmModel::behind_backlash(const Eigen::VectorXd& x) const {
  JointRecording instrument = recording_;
  for (std::size_t k = 0; k < faults_.size(); ++k)
    if (const double size = blocks_.joints.of(x)[static_cast<Eigen::Index>(k)]; size != 0 && faults_[k].mend)
      faults_[k].mend(instrument, size);
  for (std::size_t k = 0; k < moving_.size(); ++k)
    put_behind_gap(instrument, moving_[k], blocks_.backlash.of(x)[static_cast<Eigen::Index>(k)]);
  return instrument;
}

Eigen::Matrix<double, 6, 1> ArmModel::difference(const TimedPose& pose, const Rigid3& camera_from_rcm,
                                                 const JointVector& q, const Eigen::VectorXd& x) const {
  const Rigid3 expected = camera_from_marker(marker_, camera_from_rcm, q);
  const Observation::MarkerPose& seen = pose.marker;
  double focal = 0;
  for (std::size_t k = 0; k < faults_.size(); ++k)
    if (!faults_[k].mend && !faults_[k].gives_with) focal += blocks_.joints.of(x)[static_cast<Eigen::Index>(k)];
  const Eigen::Vector3d origin = pose.origin() + focal * pose.by_focal.origin_m;
  const Eigen::Vector3d turned = focal * pose.by_focal.turn_rad;
  const Eigen::Quaterniond seen_rotation =
      focal != 0 ? rotation_by(turned) * seen.camera_from_marker.rotation : seen.camera_from_marker.rotation;
  const Eigen::Vector3d ray = origin.normalized(), side = ray.unitOrthogonal();
  const Eigen::Vector3d turn = seen_rotation * rotation_vector_of(expected.rotation.conjugate() * seen_rotation);
  const Eigen::Vector3d axis = seen_rotation * Eigen::Vector3d::UnitZ(), hinge = axis.cross(ray).normalized();
  const Eigen::Vector3d off_m = (1 + blocks_.scale.of(x)[0]) * origin - expected.translation;
  const double sigma_axis_rad = seen.sigma_axis_rad / std::sqrt(2.0);
  Eigen::Matrix<double, 6, 1> d;
  d << side.dot(off_m) / seen.sigma_xy_m, ray.cross(side).dot(off_m) / seen.sigma_xy_m, ray.dot(off_m) / seen.sigma_z_m,
      hinge.cross(axis).dot(turn) / sigma_axis_rad, (hinge.dot(turn) - blocks_.tilt.of(x)[0]) / sigma_axis_rad,
      axis.dot(turn) / seen.sigma_roll_rad;
  return d;
}

namespace {

// By a quantile, so that a few wrong poses do not count and a part of the recording does.
Eigen::VectorXd noise_of(const Eigen::MatrixXd& residuals) {
  constexpr double part = 0.9, of_normal = 1.645;
  Eigen::VectorXd noise(residuals.rows());
  for (Eigen::Index channel = 0; channel < residuals.rows(); ++channel) {
    const Eigen::VectorXd sizes = residuals.row(channel).cwiseAbs();
    noise[channel] = quantile_of({sizes.begin(), sizes.end()}, part) / of_normal;
  }
  return noise;
}

// Sigmas of an arm's numbers: from the residuals' scatter, times this, but nowhere smaller than from the information
// alone: in directions that the motion leaves open, residuals scatter little.
Eigen::MatrixXd arm_covariance(const FrameFit& fit) {
  return covariance_at_least(unmodelled_sigmas * unmodelled_sigmas * fit.covariance, fit.independent);
}

// A width of half of what the joint travels, or more, is no gap: a width below 0 turns readings about their first one
// into twice as much, which is another fault.
bool is_backlash(const std::array<double, 4>& widths, const JointRanges& ranges) {
  for (std::size_t j = 0; j < 4; ++j)
    if (2 * std::abs(widths[j]) > ranges.travel(j)) return false;
  return true;
}

// Model and fit alone.
std::optional<ArmFit> fit_model(const Instrument& instrument, const ArmStart& start, const JointRecording& recording,
                                const ArmFaults& free, const std::vector<JointFault>& held,
                                const AtIteration& at_iteration) {
  ArmFaults faults = free;
  faults.joints.insert(faults.joints.end(), held.begin(), held.end());
  ArmModel model(instrument, start, recording, faults);
  // The scale and the tilt are numbers of the model. Nothing in it is the roll that follows the side of the print and
  // the place in the image, as in compressed video: it is up to the half of a frame's error that is no noise.
  Eigen::VectorXd alike = Eigen::VectorXd::Zero(6);
  alike[5] = common_roll_part;
  auto fit = fit_frames([&](const Eigen::VectorXd& x) { return model.residuals(x); }, model.unknowns(),
                        2 * poses_per_second(start.poses), at_iteration, held.size(), alike);
  if (!fit || !is_backlash(model.backlash_of(fit->x), start.ranges)) return std::nullopt;
  return ArmFit{std::move(model), std::move(*fit), {}, {}, {}};
}

// The noise that a fault leaves, and the fault in words.
struct Explanation {
  Eigen::VectorXd noise;
  std::string text;

  // A geometric mean: a fault that shows in some channels only is not hidden by the others.
  double left() const { return noise.array().log().mean(); }
};

class Explainer {
 public:
  Explainer(const Instrument& instrument, const std::vector<TimedPose>& poses, const JointRecording& recording,
            const std::string& source, const AtIteration& at_iteration)
      : instrument_(instrument),
        poses_(some_of(poses, enough)),
        recording_(recording),
        source_(source),
        at_iteration_(at_iteration) {}

  // Whether there is a fit.
  bool try_fault(const JointFault& fault, double start_size) {
    JointRecording recording = recording_;
    const bool has_size = fault.step > 0;
    if (fault.mend && (!has_size || start_size != 0)) fault.mend(recording, start_size);
    if (!has_size && recording.joints == recording_.joints) return false;  // they do not have it
    ArmFaults free;
    if (has_size) free.joints.push_back(fault);
    const auto fitted = fit_to(fault.mend ? poses_ : with_focal(poses_, start_size), recording, free);
    if (!fitted) return false;
    const double more = has_size ? fitted->model.blocks().joints.of(fitted->fit.x)[0] : 0;
    const double size = (1 + start_size) * (1 + more) - 1;
    // Nearer to none than to where it started it is none: a joint that stood still moves by no scale.
    if (std::abs(size) < std::abs(size - start_size)) return false;
    add(*fitted, fault.text(size));
    return true;
  }

  // The noise of a fit without a fault.
  std::optional<Eigen::VectorXd> noise_without() const {
    const auto fitted = fit_to(poses_, recording_, {});
    return fitted ? std::optional(noise_of(fitted->fit.residuals)) : std::nullopt;
  }

  const std::optional<Explanation>& best() const { return best_; }

 private:
  static constexpr std::size_t enough = 120;  // poses: more of them explain nothing better

  std::optional<ArmFit> fit_to(const std::vector<TimedPose>& poses, const JointRecording& recording,
                               const ArmFaults& free) const {
    try {
      const ArmStart start = start_arm(instrument_, poses, recording, source_);
      if (!start.refusal.empty()) return std::nullopt;
      return fit_model(instrument_, start, recording, free, {}, at_iteration_);
    } catch (const InputError&) {  // a mended clock may leave no time in common
      return std::nullopt;
    }
  }

  void add(const ArmFit& fitted, std::string text) {
    Explanation explained{noise_of(fitted.fit.residuals), std::move(text)};
    if (!best_ || explained.left() < best_->left()) best_ = std::move(explained);
  }

  const Instrument& instrument_;
  std::vector<TimedPose> poses_;
  const JointRecording& recording_;
  const std::string& source_;
  const AtIteration& at_iteration_;
  std::optional<Explanation> best_;
};

// Faults to try: of those with a size, the ones that a fit without them sees; all where there is no such fit.
std::vector<JointFault> possible_faults(const Joints& joints, const std::vector<TimedPose>& poses, double delay_s,
                                        const ArmFit* fit) {
  std::vector<JointFault> faults = other_joint_faults(joints);
  const auto sized = sized_joint_faults(joints, poses, delay_s);
  if (!fit) faults.insert(faults.end(), sized.begin(), sized.end());
  if (!fit) return faults;
  const Departures& departures = fit->fit.departures;
  for (const auto* seen : {&departures.seen, &departures.instead})
    for (const Fault& one : *seen) faults.push_back(sized[one.which]);
  return faults;
}

}  // namespace

std::optional<ArmFit> fit_arm(const Instrument& instrument, const ArmStart& start, const JointRecording& recording,
                              const ArmFaults& free, const AtIteration& at_iteration) {
  auto faults = sized_joint_faults(instrument.joints.value(), start.poses, start.delay_s);
  std::erase_if(faults, [&](const JointFault& held) {
    return std::ranges::any_of(free.joints, [&](const JointFault& fault) { return fault.text(0) == held.text(0); });
  });
  auto result = fit_model(instrument, start, recording, free, faults, at_iteration);
  if (!result) return std::nullopt;
  result->noise = noise_of(result->fit.residuals);
  result->covariance = arm_covariance(result->fit);
  const Departures& without = result->fit.departures;
  if (without.seen.empty()) return result;
  // To first order only: with those that are seen free, the fit shows by how much they put it off.
  ArmFaults with = free;
  for (const Fault& seen : without.seen) with.joints.push_back(faults[seen.which]);
  const auto without_bias = fit_model(instrument, start, recording, with, faults, at_iteration);
  if (!without_bias) return std::nullopt;
  const FrameFit& fit = without_bias->fit;
  const Eigen::Index numbers = result->fit.x.size(), joints = without_bias->model.blocks().joints.first;
  const Eigen::VectorXd bias = result->fit.x - fit.x.head(numbers);
  result->covariance = (arm_covariance(fit) + fit.departures.by_seen).topLeftCorner(numbers, numbers) +
                       bias * bias.transpose() + without.by_instead;
  Eigen::VectorXd sizes = fit.x.segment(joints, static_cast<Eigen::Index>(with.joints.size()));
  for (std::size_t k = free.joints.size(); k < with.joints.size(); ++k) {
    const JointFault& fault = with.joints[k];
    const Fault& seen = without.seen[k - free.joints.size()];
    double& size = sizes[static_cast<Eigen::Index>(k)];
    // A fault that the others explain as well is hardly there beside them.
    if (!seen.is_clear || std::abs(size) <= std::max(fault.least, std::abs(seen.size) / 4)) continue;
    for (std::size_t other = k + 1; fault.gives_with && other < with.joints.size(); ++other)
      if (with.joints[other].gives_with == fault.gives_with)
        size = std::hypot(size, std::exchange(sizes[static_cast<Eigen::Index>(other)], 0));
    result->faults.push_back(fault.text(size));
  }
  return result;
}

std::string explaining_fault(const Instrument& instrument, const std::vector<TimedPose>& poses,
                             const JointRecording& recording, const std::string& source, const ArmFit* fit,
                             const AtIteration& at_iteration) {
  if (poses.size() < min_registration_poses) return {};
  Explainer explainer(instrument, poses, recording, source, at_iteration);
  const double delay_s =
      fit ? fit->model.blocks().delay.of(fit->fit.x)[0] : start_arm(instrument, poses, recording, source).delay_s;
  for (const JointFault& fault : possible_faults(instrument.joints.value(), poses, delay_s, fit))
    for (const double start : fault.starts)
      if (explainer.try_fault(fault, start) && fault.is_linear) break;
  // It explains them when little is left by the images' noise or beside what there was, and much less somewhere.
  constexpr double most_left = 3, most_part_left = 1 / 3.0, least_gain = 1.5;
  const auto& best = explainer.best();
  if (!best) return {};
  const double left = best->noise.maxCoeff();
  const auto without = fit ? std::optional(fit->noise) : explainer.noise_without();
  // Residuals within the frames' own sigmas are no misfit: less than those explains nothing.
  const bool gains = !without || without->cwiseMax(1).cwiseQuotient(best->noise.cwiseMax(1)).maxCoeff() > least_gain;
  const bool is_little = left < most_left || (fit && left < most_part_left * fit->noise.maxCoeff());
  return gains && is_little ? best->text : std::string();
}

}  // namespace lapservo::internal
