#include "lapservo/vision/model/turn_blur.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace lapservo::internal {
namespace {

// With constant acceleration from rest psi has a mean of T / 3 over the exposure that turns it by T, a mean square of
// T^2 / 5, and T / 4 in the middle: the latter two by the mean. And how far the middle is off, by psi's variance.
constexpr double mean_square = 3 * 3 / 5.0, middle = 3.0 / 4;
constexpr double square_of_uneven = (1 - middle) * (1 - middle) / (mean_square - 1);

// How steep the boundaries are: the mean of their squares [px^2/rad^2], and which show at all.
struct Steepness {
  Eigen::Vector4d squares = Eigen::Vector4d::Zero();
  std::array<int, 4> points{};

  explicit Steepness(const EdgeMeasurements& pass) {
    for (const Measurement& m : pass.all) {
      if (m.group >= points.size()) continue;
      const double steepness = m.row[psi_unknown];
      squares[static_cast<Eigen::Index>(m.group)] += steepness * steepness, ++points[m.group];
    }
    for (std::size_t k = 0; k < points.size(); ++k) squares[static_cast<Eigen::Index>(k)] /= std::max(1, points[k]);
  }
  bool shows(std::size_t boundary) const { return points[boundary] >= turn_blur_limits.min_points; }
};

// Other blurs of one boundary by more than another [px^2].
double else_px2(const EllipseEvidence::Squares& blurs, const Steepness& steepness, double sides_px, bool processed) {
  const double usual_px2 = usual_blur_px * usual_blur_px;
  double ends_px2 = 0;
  for (const Eigen::Index end : {0, 3})
    if (steepness.shows(static_cast<std::size_t>(end))) ends_px2 = std::max(ends_px2, blurs.px2[end]);
  const double moved_px2 = std::max(0.0, ends_px2 - usual_px2) + std::max(0.0, sides_px * sides_px - usual_px2);
  return std::hypot(turn_blur_limits.unexplained_px2, moved_px2, processed ? turn_blur_limits.of_processing_px2 : 0);
}

}  // namespace

TurnBlur turn_blur(const EdgeMeasurements& pass, const EdgeBlur& located_with, bool processed) {
  const Steepness steepness(pass);
  if (!steepness.shows(1) || !steepness.shows(2) || !(steepness.shows(0) || steepness.shows(3))) return {};
  const auto blurs = pass.ellipse.squares(located_with);
  const double unexplained_px2 = else_px2(blurs, steepness, located_with.sides_px, processed);
  // A straight line of the blurs' squares over the squared steepness.
  Eigen::Matrix4d covariance = blurs.covariance;
  covariance.diagonal().array() += unexplained_px2 * unexplained_px2;
  Eigen::Matrix<double, 4, 2> line;
  line << Eigen::Vector4d::Ones(), steepness.squares;
  const Eigen::LDLT<Eigen::Matrix4d> factor(covariance);
  const Eigen::Matrix<double, 4, 2> weighted = factor.solve(line);
  const Eigen::Matrix2d information = line.transpose() * weighted;
  const double determinant = information.determinant();
  if (!(determinant > 0)) return {};
  const Eigen::Vector2d found = information.inverse() * (weighted.transpose() * blurs.px2);
  // Where the blurs don't lie on that line, it was something else.
  const Eigen::Vector4d left_px2 = blurs.px2 - line * found;
  const int degrees = steepness.shows(0) && steepness.shows(3) ? 2 : 1;
  const double squares = left_px2.dot(factor.solve(left_px2)) / degrees;
  const double misfit = std::max(1.0, turn_blur_limits.misfit_fraction * squares);
  return {found[1], std::sqrt(misfit * information(0, 0) / determinant)};
}

double variance_of_uneven_turn(const TurnBlur& blur, std::optional<double> change_rad) {
  // A start from rest within the exposure is off by a fourth of how far psi has come.
  const double most_rad = turn_blur_limits.uneven_of_change * change_rad.value_or(0), from_rest_rad = most_rad / 2;
  if (!(blur.sigma_rad2 > 0)) return from_rest_rad * from_rest_rad;
  if (!(blur.variance_rad2 > turn_blur_limits.told_sigmas * blur.sigma_rad2)) return 0;
  const double told = square_of_uneven * blur.variance_rad2;
  return change_rad ? std::min(told, most_rad * most_rad) : told;
}

}  // namespace lapservo::internal
