#include "lapservo/calibration/check/arm_check.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "lapservo/calibration/check/rig_check.h"
#include "lapservo/calibration/registration/arm_fit.h"
#include "lapservo/calibration/registration/arm_start.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/joint_conversion.h"

namespace lapservo::internal {
namespace {

// Smaller faults than these are not taken out of the others: they would widen them for nothing.
constexpr double least_focal = 2e-3, least_drift_m = 0.5e-3, least_drift_rad = 2e-3;

// By how much the marker in the middle of its work moves in the camera over the recording.
Told drift_of_place(const ArmFit& f) {
  const Block& drift = f.model.blocks().drift;
  const Rigid3 camera_from_rcm = f.model.camera_from_rcm(f.fit.x);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const TimedPose& pose : f.model.poses()) mean += pose.origin() / static_cast<double>(f.model.poses().size());
  const Eigen::Vector3d arm = camera_from_rcm.inverse() * mean;
  Eigen::Matrix<double, 3, 6> by_drift = Eigen::Matrix<double, 3, 6>::Identity();
  for (Eigen::Index k = 0; k < 3; ++k)
    by_drift.col(3 + k) = camera_from_rcm.rotation * Eigen::Vector3d::Unit(k).cross(arm);
  const Eigen::Matrix3d covariance = by_drift * drift.of(f.covariance) * by_drift.transpose();
  return {(by_drift * drift.of(f.fit.x)).norm(), std::sqrt(std::max(0.0, covariance.trace()))};
}

Told drift_of_directions(const ArmFit& f) {
  const Block& drift = f.model.blocks().drift;
  return {drift.of(f.fit.x).tail<3>().norm(), std::sqrt(drift.of(f.covariance).bottomRightCorner<3, 3>().trace())};
}

Rigid3 marker_at(const Instrument& instrument, const Rigid3& camera_from_rcm, const Joints& joints,
                 const std::array<double, 4>& at) {
  const auto q = JointVector::from_vector(q_from_joints(joints, Eigen::Vector4d(at.data())));
  return camera_from_marker(instrument.marker, camera_from_rcm, q);
}

ArmResidual difference(const Camera& camera, const Marker& marker, double time_s, const Rigid3& expected,
                       const Rigid3& seen) {
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ(), middle(0, 0, marker.length_m() / 2);
  const Eigen::Vector3d turn = rotation_vector_of(expected.rotation.conjugate() * seen.rotation);
  const Eigen::Vector3d a = expected * middle, b = seen * middle;
  const double axis_rad = std::atan2((expected.rotation * z).cross(seen.rotation * z).norm(),
                                     (expected.rotation * z).dot(seen.rotation * z));
  // A point behind the camera has no image: it counts as far off as the image is wide.
  const double pixel_px =
      a.z() > 1e-3 ? std::min<double>(camera.width_px, (camera.raw_from_point(a) - camera.raw_from_point(b)).norm())
                   : camera.width_px;
  return {time_s, pixel_px, (expected.translation - seen.translation).norm(), axis_rad, std::abs(turn.z())};
}

// The rig, or a fit, with the joints as they were `delay_s` before each frame.
std::vector<ArmResidual> residuals(const Instrument& instrument, const Camera& camera, const ArmStart& start,
                                   const JointRecording& recording, const Rigid3& camera_from_rcm, const Joints& joints,
                                   double delay_s) {
  std::vector<ArmResidual> all;
  for (const TimedPose& pose : start.poses)
    if (const auto at = recording.at(pose.time_s - delay_s))
      all.push_back(difference(camera, instrument.marker, pose.time_s,
                               marker_at(instrument, camera_from_rcm, joints, *at), pose.marker.camera_from_marker));
  return all;
}

// By how much the fit's registration may be off at the markers: place, direction and turn.
Eigen::Vector3d registration_sigmas(const ArmFit& f) {
  const Eigen::MatrixXd& c = f.covariance;
  const ArmModel::Blocks& blocks = f.model.blocks();
  const double turn_rad = std::sqrt(blocks.rotation.of(c).trace());
  double rho_m = 0;
  const Eigen::Vector3d rcm = f.model.camera_from_rcm(f.fit.x).translation;
  for (const TimedPose& pose : f.model.poses())
    rho_m += (pose.origin() - rcm).norm() / static_cast<double>(f.model.poses().size());
  // The joint offsets' share goes with the rotation's and the translation's: their sum is known better than each.
  const double place_m = std::hypot(std::sqrt(blocks.translation.of(c).trace()), 0.2 * turn_rad * rho_m);
  return Eigen::Vector3d(place_m, turn_rad, std::sqrt(blocks.offsets.of(c)(2, 2)) + turn_rad);
}

}  // namespace

ArmCheck check_arm(const Instrument& instrument, const Camera& camera, const std::vector<TimedPose>& poses,
                   const std::vector<TrackedPsi>& tracked, const JointRecording& recording, const std::string& source) {
  ArmCheck check;
  const ArmStart start = start_arm(instrument, poses, recording, source);
  const auto refused = [&](const std::string& why) {
    const std::string fault = explaining_fault(instrument, poses, recording, source, nullptr);
    return check.refusal = fault.empty() ? why : fault, check;
  };
  if (!start.refusal.empty()) return refused(start.refusal);
  check.region = ranges_text(*instrument.joints, start.ranges);
  const std::vector<JointFault> focal{focal_fault()};
  const auto full = fit_arm(instrument, start, recording, {true, focal});
  if (!full) return refused(std::string("the motion leaves the registration open: ") + swing_more);
  const Eigen::Index first = full->model.blocks().joints.first;  // of the faults that are fitted
  check.focal = {std::abs(full->fit.x[first]), std::sqrt(full->covariance(first, first))};
  check.drift_m = drift_of_place(*full), check.drift_rad = drift_of_directions(*full);
  const ArmFaults there{check.drift_m.exceeds(least_drift_m) || check.drift_rad.exceeds(least_drift_rad),
                        check.focal.exceeds(least_focal) ? focal : std::vector<JointFault>{}};
  const auto best = fit_arm(instrument, start, recording, there);
  if (!best) return refused(std::string("the motion leaves the registration open: ") + swing_more);

  check.noise_across = best->noise.head<2>().maxCoeff(), check.noise_roll = best->noise[5];
  check.noise = best->noise.maxCoeff();
  if (check.noise > rig_limits.noise) check.fault = explaining_fault(instrument, poses, recording, source, &*best);
  if (check.fault.empty() && !best->faults.empty()) check.fault = best->faults.front();
  const Eigen::VectorXd& x = best->fit.x;
  const Rigid3 camera_from_rcm = best->model.camera_from_rcm(x);
  const Joints joints = best->model.joints(x);
  const Block& delay = best->model.blocks().delay;
  check.measured_delay_s = delay.of(x)[0];
  check.at_best = residuals(instrument, camera, start, recording, camera_from_rcm, joints, check.measured_delay_s);
  if (instrument.image_delay_s)
    check.delay_s = Told{std::abs(*instrument.image_delay_s - check.measured_delay_s),
                         std::sqrt(delay.of(best->covariance).trace())};
  if (!instrument.camera_from_rcm) return check;
  const double delay_s = instrument.image_delay_s.value_or(check.measured_delay_s);
  check.by_rig =
      residuals(instrument, camera, start, recording, *instrument.camera_from_rcm, *instrument.joints, delay_s);
  for (const TrackedPsi& seen : tracked)
    if (const auto at = recording.at(seen.time_s - delay_s)) {
      const double psi_rad = q_from_joints(*instrument.joints, Eigen::Vector4d(at->data()))[3];
      check.beyond_encoder.push_back({seen.time_s, wrap_pi(seen.psi_rad - psi_rad)});
    }
  std::vector<ArmResidual> between;
  for (std::size_t i = 0; i < start.poses.size(); ++i)
    between.push_back(
        difference(camera, instrument.marker, start.poses[i].time_s,
                   marker_at(instrument, *instrument.camera_from_rcm, *instrument.joints, start.joints[i]),
                   marker_at(instrument, camera_from_rcm, joints, start.joints[i])));
  const Eigen::Vector3d sigmas = registration_sigmas(*best);
  for (std::size_t i = 0; i < joints.sign.size(); ++i)
    if (joints.sign[i] != instrument.joints->sign[i]) check.other_signs.push_back(joints.names[i]);
  check.place_m = Told{rms(between, &ArmResidual::position_m), sigmas[0]};
  check.axis_rad = Told{rms(between, &ArmResidual::axis_rad), sigmas[1]};
  check.roll_rad = Told{rms(between, &ArmResidual::roll_rad), sigmas[2]};
  return check;
}

}  // namespace lapservo::internal
