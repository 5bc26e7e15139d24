#include "lapservo/vision/model/rig_errors.h"

#include <cmath>
#include <numeric>

namespace lapservo::internal {
namespace {

// One sigma of the exponent by which light may be off: v^(1 + x) differs from v by x v ln(v), by 0.28 x at most beside
// what another exposure makes of it.
double sigma_exponent(const Response& response) {
  constexpr double value_by_exponent = 0.28;
  return response.sigma.value_or(0) / value_by_exponent;
}

// By how much each boundary lies aside where the bands' errors add up, in proportion to its place: that looks like no
// rotation.
std::array<double, 4> moved_by_length_m(const std::array<double, 3>& bands_m, const std::array<double, 3>& sigmas_m) {
  const double fraction =
      std::accumulate(sigmas_m.begin(), sigmas_m.end(), 0.0) / std::accumulate(bands_m.begin(), bands_m.end(), 0.0);
  std::array<double, 4> moved_m{};
  for (std::size_t k = 0; k < bands_m.size(); ++k) moved_m[k + 1] = moved_m[k] + fraction * bands_m[k];
  return moved_m;
}

}  // namespace

bool has_sigmas(const Camera& camera, const Marker& marker) {
  CameraSigmas geometry = camera.sigmas;
  geometry.blue = geometry.red = 0;
  return geometry != CameraSigmas{} || camera.response.sigma || marker.measured_sigma_m();
}

RigErrors::RigErrors(const Camera& camera, const Marker& marker, const std::array<double, 4>& by_exponent_px)
    : camera_(&camera) {
  if (marker.measured_sigma_m()) {
    const auto upper_m = moved_by_length_m(marker.bands_upper_m, *marker.sigmas.bands_upper_m),
               lower_m = moved_by_length_m(marker.bands_lower_m, *marker.sigmas.bands_lower_m);
    for (std::size_t k = 0; k < length_m_.size(); ++k) length_m_[k] = {upper_m[k], lower_m[k]};
  }
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
  const bool of_print = measurement.group < length_m_.size();
  const double turned = measurement.turn_fraction;
  const auto length = [&](std::size_t group) {
    return measurement.along_px_per_m * ((1 - turned) * length_m_[group][0] + turned * length_m_[group][1]);
  };
  Shifts shifts;
  shifts << common * (by_fx + by_fy), own * by_fx, own * by_fy, along(sigma.cx_px, 0), along(0, sigma.cy_px),
      k[0] * distorted(x * r2, y * r2), k[1] * distorted(x * r2 * r2, y * r2 * r2),
      k[2] * distorted(2 * x * y, r2 + 2 * y * y), k[3] * distorted(r2 + 2 * x * x, 2 * x * y),
      k[4] * distorted(x * r2 * r2 * r2, y * r2 * r2 * r2), of_print ? response_px_[measurement.group] : 0,
      of_print ? length(measurement.group) : 0;
  return shifts;
}

}  // namespace lapservo::internal
