#include "lapservo/vision/model/turn_blur.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace lapservo::internal {
namespace {

// With constant acceleration from rest, by psi's variance over the exposure: a turn T has a variance of 4/45 T^2 about
// its mean, which lies T / 12 from psi in the middle.
constexpr double square_of_uneven = 45.0 / 4 / 144;

// One boundary: its blur's variance, and by how much that grows with psi's.
struct BoundaryBlur {
  int points = 0;
  double steepness2 = 0;  // mean, [px/rad] squared
  double variance_px2 = 0, information = 0;

  bool seen() const { return points >= turn_blur_limits.min_points && information > 0; }
};

std::array<BoundaryBlur, 4> blurs_of(const EdgeMeasurements& pass, const EdgeBlur& located_with) {
  std::array<BoundaryBlur, 4> out;
  for (const Measurement& m : pass.all) {
    if (m.group >= out.size()) continue;
    const double steepness = m.row[m.row.size() - 2];  // psi is the last unknown before the film
    ++out[m.group].points, out[m.group].steepness2 += steepness * steepness;
  }
  const bool wide = located_with.wide();
  for (std::size_t k = 0; k < out.size(); ++k) {
    const BlurEvidence& evidence = pass.boundary_blurs[k];
    if (!out[k].points || !(evidence.information > 0)) continue;
    const double blur_px = wide ? located_with.along_px[k] : located_with.boundaries_px;
    out[k].steepness2 /= out[k].points;
    out[k].variance_px2 = blur_px * blur_px + 2 * blur_px * evidence.gradient / evidence.information;
    out[k].information = evidence.information / (4 * blur_px * blur_px);
  }
  return out;
}

// What else may have blurred one boundary by more than another [px^2]: oblique motion has the shape of a turn.
double else_px2(const std::array<BoundaryBlur, 4>& blurs, double sides_px, bool processed) {
  const double usual_px2 = usual_blur_px * usual_blur_px;
  double ends_px2 = 0;
  for (const std::size_t end : {0, 3})
    if (blurs[end].seen()) ends_px2 = std::max(ends_px2, blurs[end].variance_px2);
  const double moved_px2 = std::max(0.0, ends_px2 - usual_px2) + std::max(0.0, sides_px * sides_px - usual_px2);
  return std::hypot(turn_blur_limits.unexplained_px2, moved_px2, processed ? turn_blur_limits.of_processing_px2 : 0);
}

}  // namespace

TurnBlur turn_blur(const EdgeMeasurements& pass, const EdgeBlur& located_with, bool processed) {
  const auto blurs = blurs_of(pass, located_with);
  if (!blurs[1].seen() || !blurs[2].seen() || !(blurs[0].seen() || blurs[3].seen())) return {};
  const double unexplained_px2 = else_px2(blurs, located_with.sides_px, processed);
  // A straight line of the blurs' variances over the squared steepness.
  std::array<double, 4> weights{};
  double sum = 0, mean_px2 = 0, mean_steepness2 = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    if (!blurs[k].seen()) continue;
    weights[k] = 1 / (1 / blurs[k].information + unexplained_px2 * unexplained_px2);
    sum += weights[k];
    mean_px2 += weights[k] * blurs[k].variance_px2, mean_steepness2 += weights[k] * blurs[k].steepness2;
  }
  mean_px2 /= sum, mean_steepness2 /= sum;
  double squares = 0, products = 0, information = 0;
  int degrees = -2;
  for (std::size_t k = 0; k < 4; ++k) {
    if (!blurs[k].seen()) continue;
    const double beyond_px2 = blurs[k].variance_px2 - mean_px2, steepness2 = blurs[k].steepness2 - mean_steepness2;
    squares += weights[k] * beyond_px2 * beyond_px2;
    products += weights[k] * beyond_px2 * steepness2;
    information += weights[k] * steepness2 * steepness2;
    ++degrees;
  }
  if (!(information > 0)) return {};
  // Where the blurs don't lie on that line, it was something else.
  const double variance = products / information;
  const double misfit = std::max(1.0, turn_blur_limits.misfit_fraction * (squares - variance * products) / degrees);
  return {variance, std::sqrt(misfit / information)};
}

double variance_of_uneven_turn(const TurnBlur& blur, std::optional<double> change_rad) {
  if (!(blur.sigma_rad2 > 0)) return 0;
  if (!(blur.variance_rad2 > turn_blur_limits.told_sigmas * blur.sigma_rad2)) return 0;
  const double told = square_of_uneven * blur.variance_rad2;
  if (!change_rad) return told;
  // A start from rest within the exposure is off by a fourth of how far psi has come.
  const double most_rad = turn_blur_limits.uneven_of_change * *change_rad;
  return std::min(told, most_rad * most_rad);
}

}  // namespace lapservo::internal
