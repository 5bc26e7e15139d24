#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "lapservo/control/hold_reason.h"

namespace lapservo {

/// Desired features and their derivatives by time: s_rad, r_px, l_px, d_px.
struct DesiredFeatures {
  Eigen::Vector4d features = Eigen::Vector4d::Zero();
  Eigen::Vector4d rate = Eigen::Vector4d::Zero();
  Eigen::Vector4d acceleration = Eigen::Vector4d::Zero();
  HoldReason hold = HoldReason::none;  ///< why they can't be followed: the loop holds for it, whatever they are
};

/// Where the tip of the instrument's tool is wanted, in the camera's frame. The roll is psi but for whole turns, or
/// what comes nearest to an orientation of the tip; without either it is free and stays as it is.
struct TipGoal {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  std::optional<double> roll_rad{};
  std::optional<Eigen::Quaterniond> camera_from_tip{};
};

/// f_d(t) for t >= 0; before 0 and after `duration_s` (0: endless) it rests where it is then, unless it is endless.
/// s is continuous, not wrapped.
struct Trajectory {
  double duration_s = 0;
  std::function<DesiredFeatures(double time_s)> at;
  /// Where it gives a goal of the tip, that counts and `at` does not: run() turns it into features.
  std::function<std::optional<TipGoal>(double time_s)> tip{};

  std::optional<TipGoal> tip_at(double time_s) const { return tip ? tip(time_s) : std::nullopt; }
};

Trajectory set_point(const Eigen::Vector4d& features);

/// The paper's trajectory, section V-D: f_d(t) = offset + amplitude * sin(omega t + phase), feature by feature.
struct Sinusoids {
  Eigen::Vector4d offset = Eigen::Vector4d::Zero();
  Eigen::Vector4d amplitude = Eigen::Vector4d::Zero();
  Eigen::Vector4d omega_rad_s = Eigen::Vector4d::Ones();
  Eigen::Vector4d phase_rad = Eigen::Vector4d::Zero();
};
/// Throws InputError for numbers that are not finite and omegas that are not positive.
Trajectory sinusoids(const Sinusoids& sinusoids);

/// From point to point along straight lines in feature space, at rest in each, by minimum-jerk motions (quintic; Flash
/// and Hogan 1985) that take just as long as keeps every feature within `max_rate`. s takes the shorter way round.
/// Throws InputError for fewer than two points and rates that are not positive.
Trajectory via_points(const std::vector<Eigen::Vector4d>& points, const Eigen::Vector4d& max_rate, double dwell_s = 0);

/// Natural cubic spline (twice continuously differentiable) through two points or more with times that increase, the
/// first between 0 and 3600 s, where it rests until then. Between neighbouring points that are equal in all values it
/// rests, too: there its acceleration steps. s is unwrapped. Throws InputError naming `source`, row and
/// field.
Trajectory trajectory_through(std::vector<double> times_s, std::vector<Eigen::Vector4d> features,
                              const std::string& source);
/// The tip's, at rest. Throws InputError, naming `source`, for numbers that are not finite and places farther than 1 m
/// from the camera, which look like millimetres.
Trajectory tip_set_point(const TipGoal& goal, const std::string& source);

/// The same spline through places of the tip, with its roll, which turns the shorter way between two, or without.
Trajectory tip_trajectory_through(std::vector<double> times_s, const std::vector<TipGoal>& goals,
                                  const std::string& source);

/// The same through rows of time_s,s_rad,r_px,l_px,d_px, or of the tip: time_s,x_m,y_m,z_m and, for a roll that is
/// not free, roll_rad.
Trajectory trajectory_from_csv(const std::filesystem::path& path);
Trajectory trajectory_from_csv_text(std::string_view text, const std::string& source);

}  // namespace lapservo
