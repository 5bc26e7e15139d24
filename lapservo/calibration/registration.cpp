#include "lapservo/calibration/registration.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "lapservo/calibration/arm_guess.h"
#include "lapservo/calibration/axes_meeting_point.h"
#include "lapservo/calibration/delay_search.h"
#include "lapservo/calibration/frame_fit.h"
#include "lapservo/core/error.h"
#include "lapservo/core/median.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/joint_conversion.h"
#include "lapservo/robot/backlash.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t min_poses = 40;
constexpr double largest_delay_s = 3.2;
// What a registration that is worth writing is known to.
constexpr double max_sigma_m = 3e-3, max_sigma_rad = 0.02;

// What goes with the pose (the side of the marker that is seen, a codec's habits) is neither noise nor common to all
// frames. On rendered motions it doubles the errors (docs/calibration.md).
constexpr double unmodelled = 4;  // times the variance

std::string too_few(std::size_t poses) {
  return fmt::format("the marker was found in {} frames, at least {} are needed", poses, min_poses);
}

// x: rotation about the RCM frame's axes (3), translation (3), offsets of phi, rho, psi, delay; what frames have in
// common and no number of them averages out: the scale of distances, the axis' tilt along the view; backlash of those
// joints that move.
class ArmModel {
 public:
  static constexpr Eigen::Index rotation = 0, translation = 3, offsets = 6, delay = 9, scale = 10, tilt = 11,
                                backlash = 12;

  ArmModel(const Instrument& instrument, std::vector<TimedPose> poses, const JointRecording& recording,
           const ArmGuess& guess)
      : marker_(instrument.marker), poses_(std::move(poses)), recording_(refined(recording, 5e-3)), guess_(guess) {
    constexpr std::array<double, 4> least_travel{0.05, 0.05, 5e-3, 0.05};
    for (std::size_t j = 0; j < 4; ++j) {
      const auto [low, high] = std::minmax_element(recording.joints.begin(), recording.joints.end(),
                                                   [&](const auto& a, const auto& b) { return a[j] < b[j]; });
      if ((*high)[j] - (*low)[j] > least_travel[j]) moving_.push_back(j);
    }
  }

  std::vector<Unknown> unknowns(double delay_s) const {
    // Compressed video moves the outline by some hundredths of a pixel, and the foreshortened length by more.
    constexpr double scale_prior = 2e-3, tilt_prior_rad = 5e-3;
    const Eigen::Vector3d& rcm_m = guess_.camera_from_rcm.translation;
    const auto& offset = guess_.joints.offset;
    std::vector<Unknown> all{{0, 1e-4},         {0, 1e-4},         {0, 1e-4},         {rcm_m.x(), 1e-5},
                             {rcm_m.y(), 1e-5}, {rcm_m.z(), 1e-5}, {offset[1], 1e-4}, {offset[2], 1e-5},
                             {offset[3], 1e-4}, {delay_s, 1e-3}};
    for (const double prior : {scale_prior, tilt_prior_rad}) all.push_back({0, 1e-4, prior});
    for (const std::size_t joint : moving_) all.push_back({0, joint == 2 ? 1e-5 : 1e-4});
    return all;
  }

  Rigid3 camera_from_rcm(const Eigen::VectorXd& x) const {
    const Eigen::Vector3d turn = x.segment<3>(rotation);
    return {(guess_.camera_from_rcm.rotation * rotation_by(turn)).normalized(), x.segment<3>(translation)};
  }

  Joints joints(const Eigen::VectorXd& x) const {
    Joints joints = guess_.joints;
    for (Eigen::Index i = 0; i < 3; ++i) joints.offset[static_cast<std::size_t>(i) + 1] = x[offsets + i];
    return joints;
  }

  std::array<double, 4> backlash_of(const Eigen::VectorXd& x) const {
    std::array<double, 4> widths{};
    for (std::size_t k = 0; k < moving_.size(); ++k) widths[moving_[k]] = x[backlash + static_cast<Eigen::Index>(k)];
    return widths;
  }

  // Off across the view (2) and along it; the axis turned in the picture and tilted along the view; turned about it.
  Eigen::MatrixXd residuals(const Eigen::VectorXd& x) const {
    const Rigid3 camera_from_rcm = this->camera_from_rcm(x);
    const Joints joints = this->joints(x);
    const JointRecording instrument = behind_backlash(x);
    Eigen::MatrixXd all = Eigen::MatrixXd::Zero(6, static_cast<Eigen::Index>(poses_.size()));
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      const double time_s =
          std::clamp(poses_[i].time_s - x[delay], instrument.time_s.front(), instrument.time_s.back());
      const auto at = instrument.at(time_s);
      if (!at) continue;
      const auto q = JointVector::from_vector(q_from_joints(joints, Eigen::Vector4d(at->data())));
      all.col(static_cast<Eigen::Index>(i)) = difference(poses_[i], camera_from_rcm, q, x);
    }
    return all;
  }

  const std::vector<TimedPose>& poses() const { return poses_; }

 private:
  Eigen::Index size() const { return backlash + static_cast<Eigen::Index>(moving_.size()); }

  // A width below 0 is an instrument that leads as one above 0 lets it lag: derivatives go through 0.
  JointRecording behind_backlash(const Eigen::VectorXd& x) const {
    JointRecording instrument = recording_;
    for (std::size_t k = 0; k < moving_.size(); ++k) {
      const std::size_t j = moving_[k];
      const double width = x[backlash + static_cast<Eigen::Index>(k)], size = std::abs(width);
      Backlash gap(recording_.joints.front()[j]);
      for (auto& joints : instrument.joints) {
        gap.follow(joints[j], size);
        const double behind = gap.instrument(size) - joints[j];
        joints[j] += width < 0 ? -behind : behind;
      }
    }
    return instrument;
  }

  Eigen::Matrix<double, 6, 1> difference(const TimedPose& pose, const Rigid3& camera_from_rcm, const JointVector& q,
                                         const Eigen::VectorXd& x) const {
    const Rigid3 expected = camera_from_marker(marker_, camera_from_rcm * rcm_from_unrolled(q), q.psi_rad);
    const Observation::MarkerPose& seen = pose.marker;
    const Eigen::Vector3d ray = pose.origin().normalized(), side = ray.unitOrthogonal();
    const Eigen::Quaterniond& seen_rotation = seen.camera_from_marker.rotation;
    const Eigen::Vector3d turn = seen_rotation * rotation_vector_of(expected.rotation.conjugate() * seen_rotation);
    const Eigen::Vector3d axis = pose.axis(), hinge = axis.cross(ray).normalized();
    const Eigen::Vector3d off_m = (1 + x[scale]) * pose.origin() - expected.translation;
    const double sigma_axis_rad = seen.sigma_axis_rad / std::sqrt(2.0);
    Eigen::Matrix<double, 6, 1> d;
    d << side.dot(off_m) / seen.sigma_xy_m, ray.cross(side).dot(off_m) / seen.sigma_xy_m,
        ray.dot(off_m) / seen.sigma_z_m, hinge.cross(axis).dot(turn) / sigma_axis_rad,
        (hinge.dot(turn) - x[tilt]) / sigma_axis_rad, axis.dot(turn) / seen.sigma_roll_rad;
    return d;
  }

  Marker marker_;
  std::vector<TimedPose> poses_;
  JointRecording recording_;
  ArmGuess guess_;
  std::vector<std::size_t> moving_;
};

// Of the four numbers x y z w, for a small turn about the frame's own axes.
Eigen::Vector4d quaternion_sigma(const Eigen::Quaterniond& q, const Eigen::Matrix3d& turn_covariance) {
  Eigen::Matrix<double, 4, 3> slopes;
  for (Eigen::Index i = 0; i < 3; ++i) {
    Eigen::Quaterniond turn(0, 0, 0, 0);
    turn.vec()[i] = 0.5;
    slopes.col(i) = (q * turn).coeffs();
  }
  return (slopes * turn_covariance * slopes.transpose()).diagonal().cwiseMax(0).cwiseSqrt();
}

std::string travel_of(const std::vector<std::array<double, 4>>& joints) {
  std::array<double, 4> low = joints.front(), high = low;
  for (const auto& at : joints)
    for (std::size_t j = 0; j < 4; ++j) low[j] = std::min(low[j], at[j]), high[j] = std::max(high[j], at[j]);
  return fmt::format("theta's joint moved by {:.2f} rad, phi's by {:.2f} rad, rho's by {:.1f} mm, psi's by {:.2f} rad",
                     high[0] - low[0], high[1] - low[1], 1e3 * (high[2] - low[2]), high[3] - low[3]);
}

// Frames that the recording covers whichever way the fit moves the delay, and the joints there.
struct Common {
  std::vector<TimedPose> poses;
  std::vector<std::array<double, 4>> joints;
};

Common common(const std::vector<TimedPose>& poses, const JointRecording& recording, double delay_s) {
  constexpr double margin_s = 0.1;
  Common result;
  for (const TimedPose& pose : poses) {
    const double time_s = pose.time_s - delay_s;
    const auto at = recording.at(time_s);
    if (!at || !recording.at(time_s - margin_s) || !recording.at(time_s + margin_s)) continue;
    result.poses.push_back(pose), result.joints.push_back(*at);
  }
  return result;
}

void refuse_apart(const std::vector<TimedPose>& poses, const JointRecording& recording, double about_s,
                  const std::string& source) {
  const double first_s = poses.front().time_s - about_s, last_s = poses.back().time_s - about_s;
  const double shared_s = std::min(last_s, recording.time_s.back()) - std::max(first_s, recording.time_s.front());
  if (shared_s > -largest_delay_s) return;
  throw InputError(source,
                   fmt::format("has no time in common with the frames: they run from {:.2f} to {:.2f} s, it from "
                               "{:.2f} to {:.2f} s",
                               first_s, last_s, recording.time_s.front(), recording.time_s.back()));
}

// Where the axes meet when all of them are wrong alike: in distance, and tilted along the view.
Eigen::Matrix3d common_covariance(const std::vector<TimedPose>& poses, const Eigen::Vector3d& rcm_m) {
  constexpr double common_fraction = 0.5;
  std::vector<double> scales, tilts_m;
  Eigen::Vector3d ray = Eigen::Vector3d::Zero();
  for (const TimedPose& pose : poses) {
    scales.push_back(pose.marker.sigma_z_m / pose.origin().norm());
    tilts_m.push_back(pose.marker.sigma_axis_rad * (pose.origin() - rcm_m).norm());
    ray += pose.origin();
  }
  const Eigen::Vector3d stretched = common_fraction * median(scales) * rcm_m;
  const Eigen::Vector3d tilted = common_fraction * median(tilts_m) * ray.normalized();
  return stretched * stretched.transpose() + tilted * tilted.transpose();
}

Eigen::Quaterniond usual_rotation(const std::vector<TimedPose>& poses) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const TimedPose& pose : poses) mean += pose.axis();
  const Eigen::Vector3d x = mean.normalized(), up = -Eigen::Vector3d::UnitY();
  const Eigen::Vector3d across = up - up.dot(x) * x;
  const Eigen::Vector3d z = across.norm() > 0.1 ? across.normalized() : x.unitOrthogonal();
  Eigen::Matrix3d axes;
  axes << x, z.cross(x), z;
  return Eigen::Quaterniond(axes).normalized();
}

constexpr auto swing_more =
    "swing the instrument by 0.5 rad in both directions, insert it by 20 mm and turn it, in 20 s or more";

// Half of what a frame says of its turn about the axis is the film's, the print's and the picture's processing: common
// to all frames, and not told from psi's offset.
double common_turn_rad(const std::vector<TimedPose>& poses) {
  std::vector<double> sigmas_rad;
  for (const TimedPose& pose : poses) sigmas_rad.push_back(pose.marker.sigma_roll_rad);
  return 0.5 * median(sigmas_rad);
}

void report_arm(const ArmModel& model, const FrameFit& fit, Registration& result) {
  result.camera_from_rcm = model.camera_from_rcm(fit.x);
  const Eigen::MatrixXd covariance = unmodelled * fit.covariance;
  const Eigen::VectorXd sigma = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  const Eigen::Matrix3d turn = covariance.topLeftCorner<3, 3>();
  result.sigma_translation_m = sigma.segment<3>(ArmModel::translation);
  result.sigma_quaternion = quaternion_sigma(result.camera_from_rcm.rotation, turn);
  result.sigma_rotation_rad = std::sqrt(turn.trace());
  Registration::Arm arm;
  arm.joints = model.joints(fit.x);
  for (Eigen::Index i = 0; i < 3; ++i) arm.sigma_offset[static_cast<std::size_t>(i) + 1] = sigma[ArmModel::offsets + i];
  arm.sigma_offset[3] = std::hypot(arm.sigma_offset[3], common_turn_rad(model.poses()));
  arm.image_delay_s = fit.x[ArmModel::delay], arm.sigma_image_delay_s = sigma[ArmModel::delay];
  arm.backlash = model.backlash_of(fit.x);
  result.arm = arm;
  for (std::size_t i = 0; i < model.poses().size(); ++i) {
    const TimedPose& pose = model.poses()[i];
    const auto r = fit.residuals.col(static_cast<Eigen::Index>(i));
    result.residuals.push_back({pose.time_s,
                                std::hypot(r.head<2>().norm() * pose.marker.sigma_xy_m, r[2] * pose.marker.sigma_z_m),
                                r.segment<2>(3).norm() * pose.marker.sigma_axis_rad / std::sqrt(2.0),
                                std::abs(r[5]) * pose.marker.sigma_roll_rad});
  }
}

}  // namespace

Registration register_rcm(const Instrument& instrument, const std::vector<TimedPose>& poses) {
  Registration result;
  if (poses.size() < min_poses) return result.refusal = too_few(poses.size()), result;
  const auto meeting = axes_meeting_point(poses);
  Eigen::Vector3d sigma_m = Eigen::Vector3d::Zero();
  if (meeting) {
    const Eigen::Matrix3d covariance = unmodelled * meeting->covariance + common_covariance(poses, meeting->point_m);
    sigma_m = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  }
  if (!meeting || sigma_m.norm() > max_sigma_m)
    return result.refusal = std::string("the shaft's axes are too alike to tell where they meet: ") + swing_more,
           result;
  const bool known = instrument.camera_from_rcm.has_value();
  result.camera_from_rcm = {known ? instrument.camera_from_rcm->rotation : usual_rotation(poses), meeting->point_m};
  result.sigma_translation_m = sigma_m;
  result.unknown.push_back(known ? "camera_from_rcm's rotation is the rig's: it takes --joints to measure it"
                                 : "camera_from_rcm's rotation is a convention (x along the mean shaft, z up in the "
                                   "image), not the arm's: theta, phi and psi differ from the joints' by constants");
  result.unknown.push_back("joints and image_delay_s stay as the rig has them: they take --joints");
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Eigen::Vector3d arm_m = poses[i].origin() - meeting->point_m;
    const double axis_rad = std::asin(std::min(1.0, meeting->misses_m[i] / std::max(1e-6, arm_m.norm())));
    result.residuals.push_back({poses[i].time_s, meeting->misses_m[i], axis_rad, 0});
  }
  return result;
}

Registration register_arm(const Instrument& instrument, const std::vector<TimedPose>& poses,
                          const JointRecording& recording, const std::string& source) {
  Registration result;
  if (poses.size() < min_poses) return result.refusal = too_few(poses.size()), result;
  const double about_s = instrument.image_delay_s.value_or(0);
  refuse_apart(poses, recording, about_s, source);
  const auto meeting = axes_meeting_point(poses);
  if (!meeting)
    return result.refusal = std::string("the shaft's axes are too alike to tell where they meet: ") + swing_more,
           result;
  std::vector<double> rho_m;
  for (const TimedPose& pose : poses) rho_m.push_back((pose.origin() - meeting->point_m).dot(pose.axis()));

  constexpr double least_explained = 0.5, max_misfit_rad = 0.1;
  const auto foreign = [&](const std::string& how) {
    result.refusal = "the joints do not move as the marker does (" + how +
                     "): is it this arm's recording, are names in the order theta, phi, rho, psi, do both clocks run "
                     "within 3 s of each other";
    return result;
  };
  const DelaySearch search = search_delay(poses, rho_m, recording, about_s, largest_delay_s);
  if (search.explained < least_explained)
    return foreign(fmt::format("{:.0f} % of the motion is explained", 100 * search.explained));
  const Common both = common(poses, recording, search.delay_s);
  if (both.poses.size() < min_poses)
    return result.refusal = fmt::format("{} frames lie within the recording of the joints, at least {} are needed",
                                        both.poses.size(), min_poses),
           result;
  const ArmGuess guess = guess_arm(instrument, both.poses, both.joints, meeting->point_m, search.rho_per_joint);
  if (guess.misfit_rad > max_misfit_rad) return foreign(fmt::format("axes miss by {:.2f} rad", guess.misfit_rad));

  const ArmModel model(instrument, both.poses, recording, guess);
  const auto fit = fit_frames([&](const Eigen::VectorXd& x) { return model.residuals(x); },
                              model.unknowns(search.delay_s), 2 * poses_per_second(both.poses));
  if (!fit)
    return result.refusal = "the motion leaves the registration open: " + travel_of(both.joints) + ": " + swing_more,
           result;
  report_arm(model, *fit, result);
  if (result.sigma_translation_m.norm() > max_sigma_m || result.sigma_rotation_rad > max_sigma_rad)
    result.refusal = fmt::format("it would be known to {:.1f} mm and {:.2f} degrees only; {}: {}",
                                 1e3 * result.sigma_translation_m.norm(), 57.3 * result.sigma_rotation_rad,
                                 travel_of(both.joints), swing_more);
  result.unknown.push_back("theta's offset is the rig's: camera_from_rcm turns with it");
  return result;
}

}  // namespace lapservo::internal
