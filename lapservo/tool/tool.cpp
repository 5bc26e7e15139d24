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
using internal::TipSlopes;

Rigid3 turned_about_z(double angle_rad, const Eigen::Vector3d& translation) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ())), translation};
}

Rigid3 previous_from_joint(const WristJoint& joint, double reading_rad) {
  const Rigid3 link{Eigen::Quaterniond(Eigen::AngleAxisd(joint.alpha_rad, Eigen::Vector3d::UnitX())),
                    {joint.a_m, 0, 0}};
  return link * turned_about_z(joint.theta_rad + reading_rad + joint.offset_rad, {0, 0, joint.d_m});
}

using Frames = std::array<Rigid3, 1 + Tool::max_wrist_joints>;

// The base and each joint turn a point about the z of their frames.
TipSlopes slopes_of(const Frames& frames, std::size_t joints, const Eigen::Vector3d& point) {
  TipSlopes slopes = TipSlopes::Zero();
  slopes.topLeftCorner<3, 3>().setIdentity();
  for (std::size_t i = 0; i <= joints; ++i) {
    const Eigen::Vector3d axis = frames[i].rotation * Eigen::Vector3d::UnitZ();
    slopes.col(static_cast<Eigen::Index>(3 + i)) << axis.cross(point - frames[i].translation), axis;
  }
  return slopes;
}

Covariance readings_covariance(const Tool& tool, const TipSlopes& slopes) {
  const std::size_t count = tool.wrist.size();
  const auto by_joint = [&](std::size_t i) -> Eigen::Matrix<double, 6, 1> {
    return tool.wrist[i].sigma_reading_rad * slopes.col(static_cast<Eigen::Index>(4 + i));
  };
  Covariance covariance = Covariance::Zero();
  for (std::size_t i = 0; i < count && (!tool.snake_like || 2 * i < count); ++i) {
    Eigen::Matrix<double, 6, 1> motion = by_joint(i);
    if (tool.snake_like && 2 * i + 1 < count) motion += by_joint(count - 1 - i);
    covariance += motion * motion.transpose();
  }
  return covariance;
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

Frames internal::joints_in_marker(const Tool& tool, std::span<const double> wrist_rad) {
  if (!tool.place) throw InputError("tool", "place", "missing", "where the tool sits behind the marker");
  if (tool.wrist.size() > Tool::max_wrist_joints)
    throw InputError("tool", "wrist", fmt::format("{} joints", tool.wrist.size()),
                     fmt::format("at most {}", Tool::max_wrist_joints));
  expect_wrist(tool, wrist_rad);
  Frames frames{turned_about_z(tool.place->azimuth_rad, tool.place->base_in_marker_m)};
  for (std::size_t i = 0; i < wrist_rad.size(); ++i)
    frames[i + 1] = frames[i] * previous_from_joint(tool.wrist[i], wrist_rad[i]);
  return frames;
}

TipSlopes internal::tip_slopes(const Tool& tool, std::span<const double> wrist_rad) {
  const auto frames = joints_in_marker(tool, wrist_rad);
  return slopes_of(frames, wrist_rad.size(), frames[wrist_rad.size()] * tool.last_from_tip.translation);
}

TipInMarker tip_in_marker(const Tool& tool, std::span<const double> wrist_rad) {
  const auto frames = internal::joints_in_marker(tool, wrist_rad);
  TipInMarker tip{frames[wrist_rad.size()] * tool.last_from_tip};
  tip.marker_from_tip.rotation.normalize();
  const TipSlopes slopes = slopes_of(frames, wrist_rad.size(), tip.marker_from_tip.translation);
  tip.of_place = slopes * tool.place->covariance * slopes.transpose();
  tip.of_readings = readings_covariance(tool, slopes);
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
