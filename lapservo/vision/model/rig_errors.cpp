#include "lapservo/vision/model/rig_errors.h"

#include <cmath>
#include <numeric>

namespace lapservo::internal {
namespace {

// The part by which bands are off whose errors add up.
double common_part(const std::array<double, 3>& bands_m, const std::array<double, 3>& sigmas_m) {
  return std::accumulate(sigmas_m.begin(), sigmas_m.end(), 0.0) / std::accumulate(bands_m.begin(), bands_m.end(), 0.0);
}

}  // namespace

bool has_sigmas(const Camera& camera, const Marker& marker) {
  CameraSigmas geometry = camera.sigmas;
  geometry.blue = geometry.red = 0;
  return geometry != CameraSigmas{} || camera.response.sigma || marker.measured_sigma_m() || marker.sigmas.diameter_m ||
         marker.sigmas.wrap_m || marker.sigmas.gap_rad;
}

RigErrors::RigErrors(const Camera& camera, const Marker& marker, const ShaftPose& pose,
                     const std::array<double, 4>& by_exponent_px)
    : camera_(&camera) {
  const MarkerSigmas& sigmas = marker.sigmas;
  const bool measured = marker.measured_sigma_m().has_value();
  const double upper = measured ? common_part(marker.bands_upper_m, *sigmas.bands_upper_m) : 0,
               lower = measured ? common_part(marker.bands_lower_m, *sigmas.bands_lower_m) : 0,
               wrap_m = sigmas.wrap_m.value_or(0), gap_rad = sigmas.gap_rad.value_or(0),
               wider = sigmas.diameter_m.value_or(0) / marker.diameter_m;
  // A thicker shaft looks like a nearer one whose print is shorter.
  const Rigid3& placed = pose.camera_from_unrolled;
  nearer_m_ = wider * (placed.rotation.conjugate() * placed.translation);
  const std::array<double, 4> upper_m = boundaries_m(marker, 0), slopes_m = boundary_slopes_m(marker);
  for (std::size_t k = 0; k < upper_m.size(); ++k) {
    const double lower_m = upper_m[k] + marker.covered_rad() * slopes_m[k];
    along_m_[0][k] = {upper * upper_m[k], lower * (lower_m - marker.wrap_m)};
    along_m_[1][k] = {0, wrap_m};
    along_m_[2][k] = {0, gap_rad * slopes_m[k]};
    along_m_[3][k] = {wider * upper_m[k], wider * lower_m};
  }
  // One sigma of the exponent by which light may be off: v^(1 + x) differs from v by x v ln(v), by 0.28 x at most
  // beside what another exposure makes of it.
  constexpr double value_by_exponent = 0.28;
  const double sigma_exponent = camera.response.sigma.value_or(0) / value_by_exponent;
  for (std::size_t k = 0; k < 4; ++k) response_px_[k] = sigma_exponent * by_exponent_px[k];
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
  const bool of_print = measurement.group < response_px_.size();
  const double turned = measurement.turn_fraction;
  const Eigen::Vector2d edges = measurement.along_px_per_m * Eigen::Vector2d(1 - turned, turned);
  const auto of_print_px = [&](std::size_t i) { return of_print ? edges.dot(along_m_[i][measurement.group]) : 0; };
  Shifts shifts;
  shifts << common * (by_fx + by_fy), own * by_fx, own * by_fy, along(sigma.cx_px, 0), along(0, sigma.cy_px),
      k[0] * distorted(x * r2, y * r2), k[1] * distorted(x * r2 * r2, y * r2 * r2),
      k[2] * distorted(2 * x * y, r2 + 2 * y * y), k[3] * distorted(r2 + 2 * x * x, 2 * x * y),
      k[4] * distorted(x * r2 * r2 * r2, y * r2 * r2 * r2), of_print ? response_px_[measurement.group] : 0,
      of_print_px(0), of_print_px(1), of_print_px(2), of_print_px(3) + measurement.row.segment<3>(2).dot(nearer_m_);
  return shifts;
}

}  // namespace lapservo::internal
