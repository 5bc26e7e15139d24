#include "lapservo/crtk/dvrk_frames.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/SVD>
#include <fmt/format.h>

#include "lapservo/core/error.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/joint_conversion.h"

namespace lapservo::internal {
namespace {

// The shaft's direction in a PSM's base frame, whose -z is the shaft at yaw and pitch 0.
Eigen::Vector3d shaft_axis_in_base(double yaw_rad, double pitch_rad) {
  return {std::cos(pitch_rad) * std::sin(yaw_rad), -std::sin(pitch_rad), -std::cos(pitch_rad) * std::cos(yaw_rad)};
}

struct Axes {
  Eigen::Vector3d in_base, in_camera;
};

// Over a grid of the ranges, which count as wide enough to determine a rotation.
std::vector<Axes> axes_over(const Instrument& instrument, const JointRanges& ranges) {
  constexpr int steps = 4;
  std::vector<Axes> axes;
  for (int i = 0; i <= steps; ++i)
    for (int j = 0; j <= steps; ++j) {
      const double yaw_rad = std::lerp(ranges.low[0], ranges.high[0], static_cast<double>(i) / steps);
      const double pitch_rad = std::lerp(ranges.low[1], ranges.high[1], static_cast<double>(j) / steps);
      const Eigen::Vector4d q = q_from_joints(*instrument.joints, {yaw_rad, pitch_rad, 0, 0});
      axes.push_back({shaft_axis_in_base(yaw_rad, pitch_rad),
                      instrument.camera_from_rcm->rotation * shaft_axis_in_rcm(JointVector::from_vector(q))});
    }
  return axes;
}

// The rotation that turns the ones into the others best.
Eigen::Quaterniond camera_from_base(const std::vector<Axes>& axes) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const Axes& one : axes) sum += one.in_camera * one.in_base.transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant());
  return Eigen::Quaterniond(svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose());
}

std::string matrix_text(const Rigid3& pose) {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() = pose.rotation.normalized().toRotationMatrix();
  matrix.topRightCorner<3, 1>() = pose.translation;
  std::string text;
  for (int i = 0; i < 4; ++i)
    text += fmt::format("{}[{:.12g}, {:.12g}, {:.12g}, {:.12g}]", i ? ",\n    " : "", matrix(i, 0), matrix(i, 1),
                        matrix(i, 2), matrix(i, 3));
  return "[\n    " + text + "]";
}

}  // namespace

Rigid3 dvrk_from_camera() {
  return {Eigen::Quaterniond(0, 0, 0, 1), Eigen::Vector3d::Zero()};
}

DvrkBase dvrk_base(const Instrument& instrument, const JointRanges& ranges, const std::string& source) {
  const auto& sign = instrument.joints.value().sign;
  if (sign[0] == sign[1] || sign[2] != 1 || sign[3] != 1)
    throw InputError(source, "joints.sign", fmt::format("[{}, {}, {}, {}]", sign[0], sign[1], sign[2], sign[3]),
                     "[1, -1, 1, 1] or [-1, 1, 1, 1], as a dVRK PSM's kinematics have them");
  const std::vector<Axes> axes = axes_over(instrument, ranges);
  DvrkBase base{{camera_from_base(axes), instrument.camera_from_rcm->translation}, 0};
  for (const Axes& one : axes) {
    const Eigen::Vector3d turned = base.camera_from_base.rotation * one.in_base;
    base.worst_axis_rad = std::max(base.worst_axis_rad, std::asin(std::min(1.0, turned.cross(one.in_camera).norm())));
  }
  return base;
}

std::string dvrk_base_frame_json(const Rigid3& camera_from_base, const std::string& reference_frame) {
  return fmt::format("{{\"base_frame\": {{\n  \"reference_frame\": \"{}\",\n  \"transform\": {}}}}}\n", reference_frame,
                     matrix_text(dvrk_from_camera() * camera_from_base));
}

std::string dvrk_suj_fixed_json(const Rigid3& camera_from_base, const std::string& arm, const Rigid3& ecm_measured_cp) {
  return fmt::format("{{\n  \"name\": \"{}\",\n  \"measured_cp\": {}}}\n", arm,
                     matrix_text(ecm_measured_cp * dvrk_from_camera() * camera_from_base));
}

}  // namespace lapservo::internal
