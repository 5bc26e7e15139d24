#include "lapservo/rcm/line_observation.h"

#include <cmath>

namespace lapservo {

LineObservation line_between(const Eigen::Vector2d& from_px, const Eigen::Vector2d& to_px, double sigma_px) {
  return {from_px, to_px, sigma_px * sigma_px * Eigen::Matrix4d::Identity()};
}

bool is_usable(const LineObservation& line) {
  constexpr double farthest_px = 1e9, min_length_px = 1e-6;
  return line.from_px.norm() < farthest_px && line.to_px.norm() < farthest_px && line.covariance_px2.allFinite() &&
         (line.to_px - line.from_px).norm() > min_length_px;
}

std::optional<Eigen::Vector2d> intersection_px(const LineObservation& a, const LineObservation& b) {
  constexpr double min_sine = 1e-9;
  const auto cross = [](const Eigen::Vector2d& p, const Eigen::Vector2d& q) { return p.x() * q.y() - p.y() * q.x(); };
  const Eigen::Vector2d along_a = (a.to_px - a.from_px).normalized(), along_b = (b.to_px - b.from_px).normalized();
  const double sine = cross(along_a, along_b);
  if (!(std::abs(sine) > min_sine)) return std::nullopt;
  return Eigen::Vector2d(a.from_px + cross(b.from_px - a.from_px, along_b) / sine * along_a);
}

}  // namespace lapservo
