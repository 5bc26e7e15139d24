#include "lapservo/vision/model/common_errors.h"

#include <cmath>
#include <cstddef>
#include <numeric>

#include <Eigen/Cholesky>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/core/statistics.h"
#include "lapservo/vision/model/normal_equations.h"

namespace lapservo::internal {
namespace {

using Boundaries = std::array<double, 4>;
constexpr const UsualErrors& usual = usual_errors;

double median_sigma_px(std::span<const Measurement> measurements) {
  InplaceVector<double, 4 * EdgeMeasurements::max_lines> sigmas_px;
  for (const Measurement& m : measurements)
    if (m.group < 4) sigmas_px.push_back(m.sigma_px);
  return sigmas_px.empty() ? 0 : median(sigmas_px);
}

// The part of a blur beyond the usual.
double beyond_px2(double blur_px, double usual_px) {
  return std::max(0.0, blur_px * blur_px - usual_px * usual_px);
}

double beyond_usual_blur_px(const EdgeBlur& blur) {
  return std::max(0.0, blur.widest_px() - usual_blur_px);
}

// `moved_px`: by the camera's processing, root mean square of the boundaries; so much of it is uncertain.
PrintDoubt doubt_of(double sigma_px, const EdgeBlur& blur, double radius_px, double moved_px,
                    double doubted_of_processing) {
  const double beyond_usual_px = std::max(0.0, sigma_px - usual.usual_sigma_px), blur_px = beyond_usual_blur_px(blur);
  const double width_px = blur.boundaries_px();
  const double moved_or_noisy_px =
      std::hypot(usual.doubted_of_sigma * beyond_usual_px, doubted_of_processing * moved_px,
                 usual.doubted_boundary_of_radius * width_px * width_px / radius_px);
  return {std::hypot(moved_or_noisy_px, usual.doubted_boundary_of_blur * blur_px),
          std::hypot(moved_or_noisy_px, usual.doubted_tilt_of_blur * blur_px),
          std::hypot(usual.doubted_length_of_sigma * beyond_usual_px, usual.doubted_length_of_blur * blur_px)};
}

// The part by which bands are off whose errors add up.
double common_part(const std::array<double, 3>& bands_m, const std::array<double, 3>& sigmas_m) {
  return std::accumulate(sigmas_m.begin(), sigmas_m.end(), 0.0) / std::accumulate(bands_m.begin(), bands_m.end(), 0.0);
}

// A measurement of a group whose residuals are fitted by a line: along the shaft in metres, a side's in pixels.
struct LinePoint {
  double value, turn_fraction, sigma;
};

// Robust: from the median on, reweighted. A boundary that lies elsewhere as a whole is no outlier to itself; one with
// few points is compared with the others, about zero.
ResidualLine line_of(std::span<const Measurement> measurements, std::size_t group) {
  constexpr int iterations = 4;
  constexpr std::size_t fewest = 8;
  constexpr double usual_slope = 1e-3;  // [m] a turn
  InplaceVector<LinePoint, EdgeMeasurements::max_lines> points;
  InplaceVector<double, EdgeMeasurements::max_lines> values;
  for (const Measurement& m : measurements) {
    if (m.group != group) continue;
    const double unit = group < 4 ? m.along_px_per_m : 1;
    const double value = m.residual_px / unit;
    points.push_back({value, group < 4 ? m.turn_fraction : 0, m.sigma_px / std::abs(unit)});
    values.push_back(value);
  }
  if (values.size() < fewest) return {};
  ResidualLine line{median(values), 0};
  for (int i = 0; i < iterations; ++i) {
    double sum = 0, turns = 0, turns_squared = 1 / (usual_slope * usual_slope), at_start = 0, at_turn = 0;
    for (const LinePoint& p : points) {
      const double weight = robust_certainty(p.value - line.at_start - line.slope * p.turn_fraction, p.sigma);
      sum += weight;
      turns += weight * p.turn_fraction;
      turns_squared += weight * p.turn_fraction * p.turn_fraction;
      at_start += weight * p.value;
      at_turn += weight * p.turn_fraction * p.value;
    }
    const double determinant = sum * turns_squared - turns * turns;
    line = {(turns_squared * at_start - turns * at_turn) / determinant,
            (sum * at_turn - turns * at_start) / determinant};
  }
  return line;
}

// A root of the camera's covariance.
RigErrors::CameraCovariance root_of_covariance(const Camera& camera) {
  const Eigen::LDLT<RigErrors::CameraCovariance> parts(camera.known_covariance());
  const RigErrors::CameraCovariance lower = parts.matrixL();
  return parts.transpositionsP().transpose() * (lower * parts.vectorD().cwiseMax(0).cwiseSqrt().asDiagonal());
}

}  // namespace

double ResidualLine::residual_px(const Measurement& m) const {
  const double unit = m.along_px_per_m != 0 ? m.along_px_per_m : 1;
  return m.residual_px - unit * (at_start + slope * m.turn_fraction);
}

ResidualLines residual_lines(std::span<const Measurement> measurements) {
  ResidualLines lines;
  for (std::size_t group = 0; group < measurement_groups; ++group) lines[group] = line_of(measurements, group);
  return lines;
}

double scatter_sigmas(std::span<const Measurement> measurements, const ResidualLines& lines) {
  double squares = 0;
  int inliers = 0;
  for (const Measurement& m : measurements) {
    const double sigmas = std::abs(lines[m.group].residual_px(m)) / m.sigma_px;
    if (m.group < 4 && sigmas <= inlier_sigmas) squares += sigmas * sigmas, ++inliers;
  }
  return inliers ? std::sqrt(squares / inliers) : 0;
}

double common_boundary_px(double blur_px, double radius_px) {
  return usual.boundary_of_blur * blur_px * blur_px / radius_px +
         usual.common_fraction_of_blur * std::max(0.0, blur_px - usual_blur_px);
}

double doubt_scale(double sigma_px, double blur_px, double bias_px) {
  return std::max(1.0, sigma_px / usual.usual_sigma_px) + std::max(0.0, blur_px - usual_blur_px) +
         bias_px / usual.doubted_processing_px;
}

CommonErrors common_errors(const EdgeMeasurements& pass, const EdgeBlur& blur,
                           const std::optional<ProcessedEdges>& processed, const Boundaries& bias_px,
                           const Boundaries& departure_px) {
  CommonErrors errors;
  errors.lines = residual_lines(pass.all);
  const double radius_px = pass.radius_px, scatter = scatter_sigmas(pass.all, errors.lines);
  const double moved_px = std::sqrt(Eigen::Map<const Eigen::Array4d>(bias_px.data()).square().mean());
  const double unexplained = processed ? std::max(0.0, processed->misfit - usual.usual_misfit) : 0;
  const double unexplained_px = usual.px_per_misfit * unexplained;
  const double fraction = processed && processed->clips ? usual.fraction_of_clipped : usual.fraction_of_processing;
  // Causes that scatter points beyond their noise move whole boundaries and sides, too.
  const double unmodelled = std::max(1.0, scatter);
  for (std::size_t k = 0; k < 4; ++k) {
    const double left_px = (processed && processed->bias_px[k] ? fraction : 1) * bias_px[k];
    errors.px[k] = unmodelled * std::hypot(common_boundary_px(blur.along_px[k], radius_px),
                                           std::hypot(left_px, unexplained_px, departure_px[k]));
  }
  // The camera's processing moves sides, too, and nobody corrects that.
  const double side_px =
      usual.common_side_px + usual.side_of_blur * beyond_px2(blur.sides_px, usual.usual_side_blur_px) / radius_px;
  errors.px[4] = errors.px[5] = unmodelled * std::hypot(side_px, usual.side_fraction_of_processing * moved_px);
  const double whole_px = usual.whole_fraction_of_blur * beyond_usual_blur_px(blur);
  const double leaning_px = usual.leaning_of_blur * beyond_px2(blur.widest_px(), usual_blur_px) / radius_px;
  errors.whole_px = unmodelled * std::hypot(whole_px, usual.whole_fraction_of_processing * moved_px);
  errors.leaning_px = unmodelled * std::hypot(leaning_px, usual.leaning_fraction_of_processing * moved_px);
  errors.bowed_px = unmodelled * (usual.bowed_fraction_of_processing * moved_px);
  errors.boundary_noise_scale = std::max(usual.least_noise_scale, scatter);
  errors.doubt =
      doubt_of(median_sigma_px(pass.all), blur, radius_px, moved_px, processed ? usual.doubted_of_processing : 1);
  return errors;
}

bool has_sigmas(const Camera& camera, const Marker& marker) {
  CameraSigmas geometry = camera.sigmas;
  geometry.blue = geometry.red = 0;
  return geometry != CameraSigmas{} || camera.covariance || camera.response.sigma || marker.measured_sigma_m() ||
         marker.sigmas.diameter_m || marker.sigmas.wrap_m || marker.sigmas.gap_rad;
}

RigErrors::RigErrors(const Camera& camera, const Marker& marker, const ShaftPose& pose,
                     const std::array<double, 4>& by_exponent_px)
    : camera_(&camera), camera_root_(root_of_covariance(camera)) {
  const MarkerSigmas& sigmas = marker.sigmas;
  const bool measured = marker.measured_sigma_m().has_value();
  const double upper = measured ? common_part(marker.bands_upper_m, *sigmas.bands_upper_m) : 0,
               lower = measured ? common_part(marker.bands_lower_m, *sigmas.bands_lower_m) : 0,
               wrap_m = sigmas.wrap_m.value_or(0), gap_rad = sigmas.gap_rad.value_or(0),
               wider = sigmas.diameter_m.value_or(0) / marker.diameter_m;
  // A thicker shaft looks like a nearer one whose print is shorter, unless that was measured in diameters.
  const Rigid3& placed = pose.camera_from_unrolled;
  nearer_m_ = wider * (placed.rotation.conjugate() * placed.translation);
  const std::array<double, 4> upper_m = boundaries_m(marker, 0), slopes_m = boundary_slopes_m(marker);
  // One sigma of the exponent by which light may be off: v^(1 + x) differs from v by x v ln(v), by 0.28 x at most
  // beside what another exposure makes of it.
  constexpr double value_by_exponent = 0.28;
  const double sigma_exponent = camera.response.sigma.value_or(0) / value_by_exponent;
  for (std::size_t k = 0; k < upper_m.size(); ++k) {
    response_px_[k] = sigma_exponent * by_exponent_px[k];
    const double lower_m = upper_m[k] + marker.covered_rad() * slopes_m[k];
    along_m_[0][k] = {upper * upper_m[k], lower * (lower_m - marker.wrap_m)};
    along_m_[1][k] = {0, wrap_m};
    along_m_[2][k] = {0, gap_rad * slopes_m[k]};
    along_m_[3][k] = (measured ? 0 : wider) * Eigen::Vector2d(upper_m[k], lower_m);
  }
}

RigErrors::Shifts RigErrors::of(const Measurement& measurement) const {
  const Camera& c = *camera_;
  const Eigen::Vector2d normal = measurement.normal.cast<double>();
  const Eigen::Array2d raw_px = measurement.expected_px.cast<double>();
  const Eigen::Array2d bent = (raw_px - Eigen::Array2d(c.cx_px, c.cy_px)) / Eigen::Array2d(c.fx_px, c.fy_px);
  // The point without its distortion, to first order.
  const auto& k = c.distortion;
  const double bent2 = bent.matrix().squaredNorm();
  const Eigen::Array2d at = bent / (1 + bent2 * (k[0] + bent2 * (k[1] + bent2 * k[4])));
  const double x = at.x(), y = at.y(), r2 = x * x + y * y;
  const auto distorted = [&](double dx, double dy) { return normal.x() * c.fx_px * dx + normal.y() * c.fy_px * dy; };
  Eigen::Matrix<double, camera_numbers, 1> by_number_px;
  by_number_px << normal.array() * bent, normal, distorted(x * r2, y * r2), distorted(x * r2 * r2, y * r2 * r2),
      distorted(2 * x * y, r2 + 2 * y * y), distorted(r2 + 2 * x * x, 2 * x * y),
      distorted(x * r2 * r2 * r2, y * r2 * r2 * r2);
  const bool of_print = measurement.group < response_px_.size();
  const double turned = measurement.turn_fraction;
  const Eigen::Vector2d edges = measurement.along_px_per_m * Eigen::Vector2d(1 - turned, turned);
  const auto of_print_px = [&](std::size_t i) { return of_print ? edges.dot(along_m_[i][measurement.group]) : 0; };
  Shifts shifts;
  shifts << camera_root_.transpose() * by_number_px, of_print ? response_px_[measurement.group] : 0, of_print_px(0),
      of_print_px(1), of_print_px(2), of_print_px(3) + measurement.row.segment<3>(2).dot(nearer_m_);
  return shifts;
}

}  // namespace lapservo::internal
