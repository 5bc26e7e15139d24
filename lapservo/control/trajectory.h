#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace lapservo {

/// Desired features and their derivatives by time: s_rad, r_px, l_px, d_px.
struct DesiredFeatures {
  Eigen::Vector4d features = Eigen::Vector4d::Zero();
  Eigen::Vector4d rate = Eigen::Vector4d::Zero();
  Eigen::Vector4d acceleration = Eigen::Vector4d::Zero();
};

/// f_d(t) for t >= 0; before 0 and after `duration_s` (0: endless) it rests where it is then, unless it is endless.
/// s is continuous, not wrapped.
struct Trajectory {
  double duration_s = 0;
  std::function<DesiredFeatures(double time_s)> at;
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

/// Natural cubic spline (twice continuously differentiable) through two points or more with times that increase; starts
/// at the first one's time. s is unwrapped. Throws InputError naming `source`, row and field.
Trajectory trajectory_through(std::vector<double> times_s, std::vector<Eigen::Vector4d> features,
                              const std::string& source);
/// The same through rows of time_s,s_rad,r_px,l_px,d_px.
Trajectory trajectory_from_csv(const std::filesystem::path& path);
Trajectory trajectory_from_csv_text(std::string_view text, const std::string& source);

}  // namespace lapservo
