#include "lapservo/calibration/registration/arm_model.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/joint_conversion.h"
#include "lapservo/robot/backlash.h"

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
  }
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

Rigid3 ArmModel::camera_from_rcm_at(const Eigen::VectorXd& x, double time_s) const {
  Rigid3 camera_from_rcm = this->camera_from_rcm(x);
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
    all.col(static_cast<Eigen::Index>(i)) = difference(poses_[i], camera_from_rcm_at(x, poses_[i].time_s), q, x);
  }
  return all;
}

JointRecording ArmModel::mended(const Eigen::VectorXd& x) const {
  JointRecording recording = recording_;
  for (std::size_t k = 0; k < faults_.size(); ++k)
    if (const double size = blocks_.joints.of(x)[static_cast<Eigen::Index>(k)]; size != 0 && faults_[k].mend)
      faults_[k].mend(recording, size);
  return recording;
}

// A width below 0 is an instrument that leads as one above 0 lets it lag: derivatives go through 0.
JointRecording ArmModel::behind_backlash(const Eigen::VectorXd& x) const {
  JointRecording instrument = mended(x);
  for (std::size_t k = 0; k < moving_.size(); ++k) {
    const std::size_t j = moving_[k];
    const double width = blocks_.backlash.of(x)[static_cast<Eigen::Index>(k)], size = std::abs(width);
    Backlash gap(instrument.joints.front()[j]);
    for (auto& joints : instrument.joints) {
      gap.follow(joints[j], size);
      const double behind = gap.instrument(size) - joints[j];
      joints[j] += width < 0 ? -behind : behind;
    }
  }
  return instrument;
}

double ArmModel::focal_change(const Eigen::VectorXd& x) const {
  double change = 0;
  for (std::size_t k = 0; k < faults_.size(); ++k)
    if (!faults_[k].mend) change += blocks_.joints.of(x)[static_cast<Eigen::Index>(k)];
  return change;
}

Eigen::Matrix<double, 6, 1> ArmModel::difference(const TimedPose& pose, const Rigid3& camera_from_rcm,
                                                 const JointVector& q, const Eigen::VectorXd& x) const {
  const Rigid3 expected = camera_from_marker(marker_, camera_from_rcm, q);
  const Observation::MarkerPose& seen = pose.marker;
  const double focal = focal_change(x);
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

}  // namespace lapservo::internal
