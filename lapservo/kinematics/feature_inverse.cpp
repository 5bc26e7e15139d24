#include "lapservo/kinematics/feature_inverse.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <optional>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "lapservo/core/angles.h"

namespace lapservo {
namespace {

// The plane that holds the camera centre (its origin), the RCM at (rcm_m, 0) and the shaft. Rays to the edges are
// given by their angle from the x axis.
struct ViewPlane {
  Eigen::Vector3d x, y;  // unit, in the camera frame
  double rcm_m;
  double ray0_rad, ray2_rad, ray3_rad;
};

ViewPlane view_plane(const ImageModel& model, const Eigen::Vector2d& rcm_px, double s_rad, double signed_r_px,
                     double d_px, double l_px) {
  const Eigen::Vector2d direction(std::sin(s_rad), std::cos(s_rad));
  const Eigen::Vector3d across(direction.x() / model.camera.fx_px, direction.y() / model.camera.fy_px, 0);
  ViewPlane plane;
  plane.rcm_m = model.camera_from_rcm.translation.norm();
  plane.x = model.camera_from_rcm.translation / plane.rcm_m;
  plane.y = (across - across.dot(plane.x) * plane.x).normalized();
  const auto angle = [&](double from_rcm_px) {
    const Eigen::Vector3d ray = model.camera.ray_from_ideal(rcm_px + from_rcm_px * direction);
    return std::atan2(ray.dot(plane.y), ray.dot(plane.x));
  };
  plane.ray0_rad = angle(signed_r_px);
  plane.ray2_rad = angle(signed_r_px + d_px);
  plane.ray3_rad = angle(signed_r_px + l_px);
  return plane;
}

// Real roots of the monic-able quartic sum c[i] t^i; nearly real ones count, the caller polishes and checks.
std::vector<double> real_roots(const std::array<double, 5>& c) {
  constexpr double nearly_real = 1e-4;  // a double root splits by the square root of rounding
  int degree = 4;
  const double largest =
      std::abs(*std::max_element(c.begin(), c.end(), [](double a, double b) { return std::abs(a) < std::abs(b); }));
  while (degree > 0 && std::abs(c[static_cast<std::size_t>(degree)]) <= 1e-14 * largest) --degree;
  if (degree == 0) return {};
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(degree, degree);
  for (int i = 0; i < degree; ++i) {
    if (i > 0) companion(i, i - 1) = 1;
    companion(i, degree - 1) = -c[static_cast<std::size_t>(i)] / c[static_cast<std::size_t>(degree)];
  }
  const Eigen::VectorXcd values = companion.eigenvalues();
  std::vector<double> roots;
  for (const std::complex<double>& value : values)
    if (std::abs(value.imag()) < nearly_real * (1 + std::abs(value))) roots.push_back(value.real());
  return roots;
}

// The shaft at inclination alpha in the plane has its facing generatrix on the camera's side, which is the side of
// `facing` = sign(sin alpha), at the signed distance h from the camera centre. The marker's ends lie on two rays, and
//   h sin(ray3 - ray0) = L sin(ray3 - alpha) sin(ray0 - alpha),   h = rcm_m sin(alpha) - facing radius.
struct InclinationEquation {
  double rcm_m, radius_m, length_m, ray0_rad, ray3_rad, facing;

  double h_m(double alpha) const { return rcm_m * std::sin(alpha) - facing * radius_m; }
  double value(double alpha) const {
    return h_m(alpha) * std::sin(ray3_rad - ray0_rad) -
           length_m * std::sin(ray3_rad - alpha) * std::sin(ray0_rad - alpha);
  }
  double slope(double alpha) const {
    return rcm_m * std::cos(alpha) * std::sin(ray3_rad - ray0_rad) +
           length_m * std::sin(ray3_rad + ray0_rad - 2 * alpha);
  }
  // In t = tan(alpha / 2), times (1 + t^2)^2.
  std::array<double, 5> quartic() const {
    const double span = std::sin(ray3_rad - ray0_rad), sum = ray3_rad + ray0_rad;
    const double constant = -facing * radius_m * span - length_m / 2 * std::cos(ray3_rad - ray0_rad);
    const double cosine = length_m / 2 * std::cos(sum), sine = length_m / 2 * std::sin(sum);
    const double sway = 2 * rcm_m * span;
    return {constant + cosine, sway + 4 * sine, 2 * constant - 6 * cosine, sway - 4 * sine, constant + cosine};
  }
};

double polished(const InclinationEquation& equation, double alpha) {
  constexpr int steps = 8;
  for (int i = 0; i < steps; ++i) {
    const double slope = equation.slope(alpha);
    const double change = equation.value(alpha) / slope;
    if (!(std::abs(change) < 0.1)) break;  // at a double root there is nothing to gain
    alpha -= change;
  }
  return alpha;
}

// Where a ray meets the facing generatrix, along the shaft from the RCM; nullopt when it does so behind the camera.
std::optional<double> along_m(const ViewPlane& plane, const InclinationEquation& equation, double alpha, double ray) {
  const double range_m = -equation.h_m(alpha) / std::sin(ray - alpha);
  if (!(range_m > 0)) return std::nullopt;
  return range_m * std::cos(ray - alpha) - plane.rcm_m * std::cos(alpha);
}

std::optional<RcmCoordinates> configuration(const ImageModel& model, const ViewPlane& plane,
                                            const InclinationEquation& equation, double alpha) {
  if (!(equation.facing * equation.h_m(alpha) > 0)) return std::nullopt;  // the camera would be inside the shaft
  const auto proximal = along_m(plane, equation, alpha, plane.ray0_rad);
  const auto inner = along_m(plane, equation, alpha, plane.ray2_rad);
  if (!proximal || !inner || !(*proximal > 0)) return std::nullopt;
  const double slope_m = boundary_slopes_m(model.marker)[2];
  const double tau = (*inner - *proximal - boundaries_m(model.marker, 0)[2]) / slope_m;
  constexpr double rounding = 1e-9;
  if (!(tau > -rounding && tau < two_pi)) return std::nullopt;

  const Eigen::Vector3d axis =
      model.camera_from_rcm.rotation.conjugate() * (std::cos(alpha) * plane.x + std::sin(alpha) * plane.y);
  RcmCoordinates q{std::atan2(axis.y(), axis.x()), std::atan2(axis.head<2>().norm(), axis.z()), *proximal, 0};
  const auto line = centre_line(model.camera, model.marker, model.camera_from_rcm * rcm_from_unrolled(q), 0);
  if (!line) return std::nullopt;
  q.psi_rad = wrap_pi(line->facing_azimuth_rad - std::max(tau, 0.0) - model.marker.seam_rad);
  return q;
}

// Nearly real roots and the two ends of the seam let through what does not show f: the map itself decides.
bool shows(const ImageModel& model, const RcmCoordinates& q, const Eigen::Vector4d& f) {
  constexpr double tolerance_rad = 1e-7, tolerance_px = 1e-4;
  const auto result = feature_map(model, q);
  if (!result.point) return false;
  const Eigen::Vector4d error = result.point->f - f;
  return std::abs(wrap_pi(error[0])) < tolerance_rad && error.tail<3>().cwiseAbs().maxCoeff() < tolerance_px;
}

double distance(const RcmCoordinates& a, const RcmCoordinates& b) {
  Eigen::Vector4d difference = a.vector() - b.vector();
  difference[2] /= std::max(std::abs(b.rho_m), 1e-3);
  return difference.norm();
}

RcmCoordinates turn_over(const RcmCoordinates& q) {
  return {q.theta_rad + pi, -q.phi_rad, q.rho_m, q.psi_rad + pi};
}

// The same configuration turned over, and each with a turn of theta and psi more or less.
std::vector<RcmCoordinates> ways_to_write(const RcmCoordinates& q) {
  std::vector<RcmCoordinates> ways;
  for (const RcmCoordinates& form : {q, turn_over(q)})
    for (const double theta_turn : {-two_pi, 0.0, two_pi})
      for (const double psi_turn : {-two_pi, 0.0, two_pi})
        ways.push_back({form.theta_rad + theta_turn, form.phi_rad, form.rho_m, form.psi_rad + psi_turn});
  return ways;
}

bool is_new(const std::vector<RcmCoordinates>& found, const RcmCoordinates& q) {
  constexpr double same = 1e-6;
  return std::none_of(found.begin(), found.end(), [&](const RcmCoordinates& other) {
    return distance(equivalent_nearest(q, other), other) < same;
  });
}

}  // namespace

std::vector<RcmCoordinates> inverse_feature_map(const ImageModel& model, const Eigen::Vector4d& f) {
  const auto rcm_px = projected_rcm_px(model.camera, model.camera_from_rcm);
  const bool usable = f.allFinite() && f[1] >= 0 && f[2] > 0 && f[3] > 0;
  if (!rcm_px || !usable || std::abs(boundary_slopes_m(model.marker)[2]) < 1e-9) return {};
  std::vector<RcmCoordinates> found;
  for (const double side : {1.0, -1.0}) {
    const ViewPlane plane = view_plane(model, *rcm_px, f[0], side * f[1], f[3], f[2]);
    for (const double facing : {1.0, -1.0}) {
      const InclinationEquation equation{plane.rcm_m,    model.marker.radius_m(), model.marker.length_m(),
                                         plane.ray0_rad, plane.ray3_rad,          facing};
      for (const double root : real_roots(equation.quartic())) {
        if (!(root * facing > 0)) continue;
        const auto q = configuration(model, plane, equation, polished(equation, 2 * std::atan(root)));
        if (q && shows(model, *q, f) && is_new(found, *q)) found.push_back(*q);
      }
    }
  }
  return found;
}

RcmCoordinates equivalent_nearest(const RcmCoordinates& q, const RcmCoordinates& reference) {
  const auto near = [](double angle, double to) { return to + wrap_pi(angle - to); };
  const auto unwound = [&](const RcmCoordinates& c) {
    return RcmCoordinates{near(c.theta_rad, reference.theta_rad), near(c.phi_rad, reference.phi_rad), c.rho_m,
                          near(c.psi_rad, reference.psi_rad)};
  };
  const RcmCoordinates direct = unwound(q);
  const RcmCoordinates turned_over = unwound(turn_over(q));
  return distance(turned_over, reference) < distance(direct, reference) ? turned_over : direct;
}

InverseResult inverse_within(const ImageModel& model, const Eigen::Vector4d& f, const RcmLimits& limits,
                             const RcmCoordinates& reference) {
  const auto nearer = [&](const RcmCoordinates& a, const RcmCoordinates& b) {
    return distance(a, reference) < distance(b, reference);
  };
  std::vector<RcmCoordinates> outside, inside;
  for (const RcmCoordinates& q : inverse_feature_map(model, f)) {
    outside.push_back(equivalent_nearest(q, reference));
    std::vector<RcmCoordinates> allowed = ways_to_write(outside.back());
    std::erase_if(allowed, [&](const RcmCoordinates& way) { return !limits.contain(way); });
    if (!allowed.empty()) inside.push_back(*std::min_element(allowed.begin(), allowed.end(), nearer));
  }
  if (outside.empty()) return {};
  if (inside.empty()) return {InverseStatus::outside_limits, *std::min_element(outside.begin(), outside.end(), nearer)};
  return {inside.size() == 1 ? InverseStatus::ok : InverseStatus::ambiguous,
          *std::min_element(inside.begin(), inside.end(), nearer)};
}

}  // namespace lapservo
