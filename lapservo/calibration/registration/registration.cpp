#include "lapservo/calibration/registration/registration.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "lapservo/calibration/marker/frame_fit.h"
#include "lapservo/calibration/registration/arm_fit.h"
#include "lapservo/calibration/registration/arm_start.h"
#include "lapservo/calibration/registration/axes_meeting_point.h"
#include "lapservo/calibration/registration/joint_faults.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/joint_conversion.h"

namespace lapservo::internal {
namespace {

// Largest sigmas of a registration that may be written.
constexpr double max_sigma_m = 3e-3, max_sigma_rad = 0.02;

// In the frames' own sigmas: up to as much, residuals are no misfit of the model.
constexpr double most_noise = 1.5;

constexpr double unmodelled = unmodelled_sigmas * unmodelled_sigmas;  // times the variance

// Jacobian of the four numbers x y z w for a small rotation about the frame's own axes.
Eigen::Vector4d quaternion_sigma(const Eigen::Quaterniond& q, const Eigen::Matrix3d& turn_covariance) {
  Eigen::Matrix<double, 4, 3> slopes;
  for (Eigen::Index i = 0; i < 3; ++i) {
    Eigen::Quaterniond turn(0, 0, 0, 0);
    turn.vec()[i] = 0.5;
    slopes.col(i) = (q * turn).coeffs();
  }
  return (slopes * turn_covariance * slopes.transpose()).diagonal().cwiseMax(0).cwiseSqrt();
}

// Where the axes meet when all of them are wrong alike: in distance, and tilted along the view.
Eigen::Matrix3d common_covariance(const std::vector<TimedPose>& poses, const Eigen::Vector3d& rcm_m) {
  constexpr double common_fraction = 0.5;
  Eigen::Vector3d ray = Eigen::Vector3d::Zero();
  for (const TimedPose& pose : poses) ray += pose.origin();
  const double scale =
      median(values_of(poses, [](const TimedPose& pose) { return pose.marker.sigma_z_m / pose.origin().norm(); }));
  const double tilt_m = median(values_of(
      poses, [&](const TimedPose& pose) { return pose.marker.sigma_axis_rad * (pose.origin() - rcm_m).norm(); }));
  const Eigen::Vector3d stretched = common_fraction * scale * rcm_m;
  const Eigen::Vector3d tilted = common_fraction * tilt_m * ray.normalized();
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

// An error that is common to all frames is indistinguishable from psi's offset.
double common_turn_rad(const std::vector<TimedPose>& poses) {
  return common_roll_part * median(values_of(poses, [](const TimedPose& pose) { return pose.marker.sigma_roll_rad; }));
}

void report_arm(const ArmFit& fitted, Registration& result) {
  const auto& [model, fit, covariance, noise, faults] = fitted;
  result.faults = faults;
  result.camera_from_rcm = model.camera_from_rcm(fit.x);
  const Eigen::VectorXd sigma = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  const ArmModel::Blocks& blocks = model.blocks();
  const Eigen::Matrix3d turn = blocks.rotation.of(covariance);
  result.sigma_translation_m = blocks.translation.of(sigma);
  result.sigma_quaternion = quaternion_sigma(result.camera_from_rcm.rotation, turn);
  result.sigma_rotation_rad = std::sqrt(turn.trace());
  Registration::Arm arm;
  arm.joints = model.joints(fit.x);
  for (Eigen::Index i = 0; i < 3; ++i) arm.sigma_offset[static_cast<std::size_t>(i) + 1] = blocks.offsets.of(sigma)[i];
  arm.covariance = covariance.topLeftCorner<9, 9>();  // of rotation, translation, offsets, as they stand there
  arm.covariance(8, 8) += std::pow(common_turn_rad(model.poses()), 2);
  arm.sigma_offset[3] = std::sqrt(arm.covariance(8, 8));
  arm.image_delay_s = blocks.delay.of(fit.x)[0], arm.sigma_image_delay_s = blocks.delay.of(sigma)[0];
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

struct Largest {
  double m, rad;
};

Largest largest_sigma(const Registration& registration) {
  const auto& sigma_offset = registration.arm->sigma_offset;
  return {std::max(registration.sigma_translation_m.norm(), sigma_offset[2]),
          std::max({registration.sigma_rotation_rad, sigma_offset[1], sigma_offset[3]})};
}

// Rms, without the tenth that is worst: an angle that wraps, a wrong pose.
Largest largest_residual(const Registration& registration) {
  const auto most = [&](double RegistrationResidual::*size) {
    return rms_but_tenth(values_of(registration.residuals, size));
  };
  return {most(&RegistrationResidual::position_m),
          std::max(most(&RegistrationResidual::axis_rad), most(&RegistrationResidual::roll_rad))};
}

std::string misfit_text(const std::string& fault) {
  return "the joints do not move as the marker does: " + fault;
}

Rigid3 placed(const Marker& marker, const Registration& registration, const std::array<double, 4>& readings,
              const Eigen::Matrix<double, 9, 1>& off) {
  Joints joints = registration.arm->joints;
  for (Eigen::Index i = 0; i < 3; ++i) joints.offset[static_cast<std::size_t>(i) + 1] += off[6 + i];
  Rigid3 camera_from_rcm = registration.camera_from_rcm;
  camera_from_rcm.rotation = camera_from_rcm.rotation * rotation_by(off.head<3>());
  camera_from_rcm.translation += off.segment<3>(3);
  const auto q = JointVector::from_vector(q_from_joints(joints, Eigen::Vector4d(readings.data())));
  return camera_from_marker(marker, camera_from_rcm, q);
}

}  // namespace

MarkerPlacementSigma placement_sigma(const Marker& marker, const Registration& registration,
                                     const std::array<double, 4>& readings) {
  constexpr double step = 1e-6;  // rad, m
  const Rigid3 is = placed(marker, registration, readings, Eigen::Matrix<double, 9, 1>::Zero());
  Eigen::Matrix<double, 6, 9> slopes;
  for (Eigen::Index i = 0; i < 9; ++i) {
    const Rigid3 off = placed(marker, registration, readings, step * Eigen::Matrix<double, 9, 1>::Unit(i));
    slopes.col(i) << (off.translation - is.translation) / step,
        rotation_vector_of(is.rotation.conjugate() * off.rotation) / step;
  }
  const Eigen::Matrix<double, 6, 1> variances =
      (slopes * registration.arm.value().covariance * slopes.transpose()).diagonal().cwiseMax(0);
  return {std::sqrt(variances.head<3>().sum()), std::sqrt(variances[3] + variances[4]), std::sqrt(variances[5])};
}

MarkerPlacementSigma placement_sigma_beyond(const Marker& marker, const Registration& registration, double beyond_rad,
                                            double beyond_m) {
  const JointRanges& ranges = registration.arm.value().ranges;
  const std::array<double, 4> beyond{beyond_rad, beyond_rad, beyond_m, beyond_rad};
  MarkerPlacementSigma most;
  for (unsigned corner = 0; corner < 16; ++corner) {
    std::array<double, 4> readings;
    for (std::size_t j = 0; j < 4; ++j)
      readings[j] = corner >> j & 1U ? ranges.high[j] + beyond[j] : ranges.low[j] - beyond[j];
    const MarkerPlacementSigma sigma = placement_sigma(marker, registration, readings);
    most = {std::max(most.place_m, sigma.place_m), std::max(most.axis_rad, sigma.axis_rad),
            std::max(most.roll_rad, sigma.roll_rad)};
  }
  return most;
}

Registration register_rcm(const Instrument& instrument, const std::vector<TimedPose>& poses,
                          const AtIteration& at_iteration) {
  Registration result;
  if (poses.size() < min_registration_poses) return result.refusal = too_few_poses(poses.size()), result;
  const auto meeting = axes_meeting_point(poses, at_iteration);
  Eigen::Vector3d sigma_m = Eigen::Vector3d::Zero();
  if (meeting) {
    const Eigen::Matrix3d covariance =
        unmodelled * meeting->covariance + meeting->by_faults + common_covariance(poses, meeting->point_m);
    sigma_m = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  }
  if (!meeting || sigma_m.norm() > max_sigma_m) {
    result.refusal = meeting && !meeting->faults.empty()
                         ? "the shaft's axes do not meet in one point: " + meeting->faults.front()
                         : std::string("the shaft's axes are too alike to locate their intersection: ") + swing_more;
    return result;
  }
  if (median(values_of(poses, [&](const TimedPose& pose) { return pose.beyond_m(meeting->point_m); })) < 0)
    return result.refusal = reversed_marker, result;
  const bool known = instrument.camera_from_rcm.has_value();
  result.camera_from_rcm = {known ? instrument.camera_from_rcm->rotation : usual_rotation(poses), meeting->point_m};
  result.sigma_translation_m = sigma_m;
  result.unknown.emplace_back(known ? "camera_from_rcm's rotation is the rig's: it takes --joints to measure it"
                                    : "camera_from_rcm's rotation is a convention (x along the mean shaft, z up in the "
                                      "image), not the arm's: theta, phi and psi differ from the joints' by constants");
  result.unknown.emplace_back("joints and image_delay_s stay as the rig has them: they take --joints");
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Eigen::Vector3d arm_m = poses[i].origin() - meeting->point_m;
    const double axis_rad = std::asin(std::min(1.0, meeting->misses_m[i] / std::max(1e-6, arm_m.norm())));
    result.residuals.push_back({poses[i].time_s, meeting->misses_m[i], axis_rad, 0});
  }
  result.faults = meeting->faults;
  if (const Largest off = largest_residual(result); off.m > max_sigma_m || off.rad > max_sigma_rad)
    result.refusal = fmt::format(
        "the shaft's axes miss one another by {:.1f} mm and {:.0f} mrad rms: {}", 1e3 * off.m, 1e3 * off.rad,
        result.faults.empty() ? "does the endoscope, the trocar or the marker move, is the focal length the camera's"
                              : result.faults.front());
  return result;
}

Registration register_arm(const Instrument& instrument, const std::vector<TimedPose>& seen,
                          const JointRecording& recording, const std::string& source, const AtIteration& at_iteration) {
  Registration result;
  const std::vector<TimedPose> poses = with_focal(seen, 0);
  const auto explained = [&](const ArmFit* fit) {
    return explaining_fault(instrument, poses, recording, source, fit, at_iteration);
  };
  const ArmStart start = start_arm(instrument, poses, recording, source);
  if (!start.refusal.empty()) {
    const std::string fault = explained(nullptr);
    return result.refusal = fault.empty() ? start.refusal : misfit_text(fault), result;
  }
  const auto fit = fit_arm(instrument, start, recording, {}, at_iteration);
  if (!fit) {
    const std::string fault = explained(nullptr);
    return result.refusal = !fault.empty() ? misfit_text(fault)
                                           : "the motion leaves the registration open: " +
                                                 travels_text(start.guess.joints, start.ranges) + ": " + swing_more,
           result;
  }
  report_arm(*fit, result);
  result.arm->ranges = start.ranges;
  const Largest sigma = largest_sigma(result), off = largest_residual(result);
  const bool is_open = sigma.m > max_sigma_m || sigma.rad > max_sigma_rad,
             is_misfit = off.m > max_sigma_m || off.rad > max_sigma_rad;
  if (is_open || is_misfit) {
    if (const std::string fault = explained(&*fit); !fault.empty() || !fit->faults.empty())
      result.refusal = misfit_text(fault.empty() ? fit->faults.front() : fault);
    else if (is_misfit && fit->noise.maxCoeff() < most_noise)
      result.refusal = fmt::format(
          "the marker is {:.1f} mm and {:.0f} mrad rms from where the joints have it, as the frames' own sigmas allow, "
          "expected at most {:.0f} mm and {:.0f} mrad: record it nearer, sharper and less compressed",
          1e3 * off.m, 1e3 * off.rad, 1e3 * max_sigma_m, 1e3 * max_sigma_rad);
    else if (is_misfit)
      result.refusal = fmt::format(
          "the marker is {:.1f} mm and {:.0f} mrad rms from where the joints have it, {:.0f} times the images' noise: "
          "is it this arm's recording, is the focal length the camera's, does something move or slip",
          1e3 * off.m, 1e3 * off.rad, fit->noise.maxCoeff());
    else
      result.refusal = fmt::format("it would be known to {:.1f} mm and {:.2f} degrees only; {}: {}", 1e3 * sigma.m,
                                   57.3 * sigma.rad, travels_text(start.guess.joints, start.ranges), swing_more);
  }
  result.unknown.emplace_back("theta's offset is the rig's: camera_from_rcm turns with it");
  return result;
}

}  // namespace lapservo::internal
