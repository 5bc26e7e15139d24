#include "lapservo/vision/model/residual_lines.h"

#include <cmath>
#include <cstddef>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/core/statistics.h"
#include "lapservo/vision/model/normal_equations.h"

namespace lapservo::internal {
namespace {

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

}  // namespace lapservo::internal
