#include "lapservo/vision/model/rig_errors.h"

#include <cmath>

namespace lapservo::internal {
namespace {

// One sigma of the exponent by which light may be off: v^(1 + x) differs from v by x v ln(v), by 0.28 x at most beside
// what another exposure makes of it.
double sigma_exponent(const Response& response) {
  constexpr double value_by_exponent = 0.28;
  return response.sigma.value_or(0) / value_by_exponent;
}

}  // namespace

bool has_sigmas(const Camera& camera) {
  CameraSigmas geometry = camera.sigmas;
  geometry.blue = geometry.red = 0;
  return geometry != CameraSigmas{} || camera.response.sigma;
}

RigErrors::RigErrors(const Camera& camera, const std::array<double, 4>& by_exponent_px) : camera_(&camera) {
  for (std::size_t k = 0; k < 4; ++k) response_px_[k] = sigma_exponent(camera.response) * by_exponent_px[k];
}

RigErrors::Shifts RigErrors::of(const Measurement& measurement) const {
  const Camera& c = *camera_;
  const CameraSigmas& sigma = c.sigmas;
  const Eigen::Vector2d normal = measurement.normal.cast<double>();
  const Eigen::Vector2d raw_px = measurement.expected_px.cast<double>();
  // Distortion is small: that of a distorted point is taken for that of the point.
  const double x = (raw_px.x() - c.cx_px) / c.fx_px, y = (raw_px.y() - c.cy_px) / c.fy_px, r2 = x * x + y * y;
  const auto along = [&](double u_px, double v_px) { return normal.x() * u_px + normal.y() * v_px; };
  const auto distorted = [&](double dx, double dy) { return along(c.fx_px * dx, c.fy_px * dy); };
  const double by_fx = along(x, 0) * sigma.fx_px, by_fy = along(0, y) * sigma.fy_px, common = std::sqrt(1.0 / 3),
               own = std::sqrt(2.0 / 3);
  const auto& k = sigma.distortion;
  Shifts shifts;
  shifts << common * (by_fx + by_fy), own * by_fx, own * by_fy, along(sigma.cx_px, 0), along(0, sigma.cy_px),
      k[0] * distorted(x * r2, y * r2), k[1] * distorted(x * r2 * r2, y * r2 * r2),
      k[2] * distorted(2 * x * y, r2 + 2 * y * y), k[3] * distorted(r2 + 2 * x * x, 2 * x * y),
      k[4] * distorted(x * r2 * r2 * r2, y * r2 * r2 * r2), measurement.group < 4 ? response_px_[measurement.group] : 0;
  return shifts;
}

}  // namespace lapservo::internal
