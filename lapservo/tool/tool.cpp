#include "lapservo/tool/tool.h"

#include <array>
#include <cmath>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "lapservo/core/error.h"
#include "lapservo/tool/wrist.h"

namespace lapservo {
namespace {

using Covariance = TipInMarker::Covariance;
using Motion = Eigen::Matrix<double, 6, 1>;

Rigid3 turned_about_z(double angle_rad, const Eigen::Vector3d& translation) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ())), translation};
}

Rigid3 previous_from_joint(const WristJoint& joint, double reading_rad) {
  const Rigid3 link{Eigen::Quaterniond(Eigen::AngleAxisd(joint.alpha_rad, Eigen::Vector3d::UnitX())),
                    {joint.a_m, 0, 0}};
  return link * turned_about_z(joint.theta_rad + reading_rad + joint.offset_rad, {0, 0, joint.d_m});
}

// How a point moves with a rotation about a frame's z, and the rotation itself.
Motion turn_about_z_of(const Rigid3& frame, const Eigen::Vector3d& point) {
  const Eigen::Vector3d axis = frame.rotation * Eigen::Vector3d::UnitZ();
  Motion motion;
  motion << axis.cross(point - frame.translation), axis;
  return motion;
}

Covariance readings_covariance(const Tool& tool, std::span<const Motion> by_joint) {
  const std::size_t count = tool.wrist.size();
  Covariance covariance = Covariance::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    Motion motion = tool.wrist[i].sigma_reading_rad * by_joint[i];
    if (tool.snake_like && 2 * i + 1 < count)
      motion += tool.wrist[count - 1 - i].sigma_reading_rad * by_joint[count - 1 - i];
    if (!tool.snake_like || 2 * i < count) covariance += motion * motion.transpose();
  }
  return covariance;
}

Covariance place_covariance(const Tool::PlaceCovariance& place, const Motion& by_azimuth,
                            std::span<const Motion> by_joint) {
  Eigen::Matrix<double, 6, 4 + Tool::max_wrist_joints> slopes;
  slopes.setZero();
  slopes.topLeftCorner<3, 3>().setIdentity();
  slopes.col(3) = by_azimuth;
  for (std::size_t i = 0; i < by_joint.size(); ++i) slopes.col(static_cast<Eigen::Index>(4 + i)) = by_joint[i];
  return slopes * place * slopes.transpose();
}

}  // namespace

std::vector<std::string> internal::wrist_names(const std::optional<Tool>& tool) {
  std::vector<std::string> names;
  if (!tool) return names;
  for (const WristJoint& joint : tool->wrist) names.push_back(joint.name);
  return names;
}

void internal::expect_wrist(const Tool& tool, std::span<const double> wrist_rad) {
  if (wrist_rad.size() != tool.wrist.size())
    throw InputError("tool", "wrist_rad", fmt::format("{} readings", wrist_rad.size()),
                     fmt::format("{}, one for each joint of the wrist", tool.wrist.size()));
  for (std::size_t i = 0; i < wrist_rad.size(); ++i)
    if (!std::isfinite(wrist_rad[i]))
      throw InputError("tool", tool.wrist[i].name, fmt::format("{}", wrist_rad[i]), "a finite angle in radians");
}

std::array<Rigid3, 1 + Tool::max_wrist_joints> internal::joints_in_marker(const Tool& tool,
                                                                          std::span<const double> wrist_rad) {
  if (!tool.place) throw InputError("tool", "place", "missing", "where the tool sits behind the marker");
  if (tool.wrist.size() > Tool::max_wrist_joints)
    throw InputError("tool", "wrist", fmt::format("{} joints", tool.wrist.size()),
                     fmt::format("at most {}", Tool::max_wrist_joints));
  expect_wrist(tool, wrist_rad);
  std::array<Rigid3, 1 + Tool::max_wrist_joints> frames{
      turned_about_z(tool.place->azimuth_rad, tool.place->base_in_marker_m)};
  for (std::size_t i = 0; i < wrist_rad.size(); ++i)
    frames[i + 1] = frames[i] * previous_from_joint(tool.wrist[i], wrist_rad[i]);
  return frames;
}

TipInMarker tip_in_marker(const Tool& tool, std::span<const double> wrist_rad) {
  const auto frames = internal::joints_in_marker(tool, wrist_rad);
  const std::size_t count = wrist_rad.size();
  TipInMarker tip{frames[count] * tool.last_from_tip};
  tip.marker_from_tip.rotation.normalize();
  const Eigen::Vector3d& point = tip.marker_from_tip.translation;
  std::array<Motion, Tool::max_wrist_joints> by_joint;
  for (std::size_t i = 0; i < count; ++i) by_joint[i] = turn_about_z_of(frames[i + 1], point);
  const std::span<const Motion> motions(by_joint.data(), count);
  tip.of_place = place_covariance(tool.place->covariance, turn_about_z_of(frames[0], point), motions);
  tip.of_readings = readings_covariance(tool, motions);
  tip.covariance_m2 = (tip.of_place + tip.of_readings).topLeftCorner<3, 3>();
  return tip;
}

Covariance tip_covariance_in_camera(const Rigid3& camera_from_marker, const Covariance& marker_covariance,
                                    const TipInMarker& tip) {
  const Eigen::Matrix3d rotation = camera_from_marker.rotation.toRotationMatrix();
  const Eigen::Vector3d arm = rotation * tip.marker_from_tip.translation;
  Covariance by_marker = Covariance::Identity();
  by_marker.topRightCorner<3, 3>() << 0, arm.z(), -arm.y(), -arm.z(), 0, arm.x(), arm.y(), -arm.x(), 0;  // turn x arm
  Covariance by_tip = Covariance::Zero();
  by_tip.topLeftCorner<3, 3>() = by_tip.bottomRightCorner<3, 3>() = rotation;
  return by_marker * marker_covariance * by_marker.transpose() +
         by_tip * (tip.of_place + tip.of_readings) * by_tip.transpose();
}

}  // namespace lapservo
