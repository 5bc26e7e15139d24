#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "lapservo/tool/tool.h"

namespace lapservo::internal {

/// The names of the wrist's joints, from the shaft to the tip; none for a straight tool and without a tool.
std::vector<std::string> wrist_names(const std::optional<Tool>& tool);

/// Throws InputError for another number of readings than the wrist has joints, and for one that is not finite.
void expect_wrist(const Tool& tool, std::span<const double> wrist_rad);

/// The base and the joints' frames behind it in the marker's frame, as many as the wrist has. Allocates nothing. Throws
/// as tip_in_marker does.
std::array<Rigid3, 1 + Tool::max_wrist_joints> joints_in_marker(const Tool& tool, std::span<const double> wrist_rad);

/// How the tip moves (position [m], rotation vector [rad], marker's axes) with each number of a place's covariance, in
/// their order; 0 for joints that the wrist lacks. Throws as tip_in_marker does.
using TipSlopes = Eigen::Matrix<double, 6, ToolPlace::Covariance::RowsAtCompileTime>;
TipSlopes tip_slopes(const Tool& tool, std::span<const double> wrist_rad);

}  // namespace lapservo::internal
