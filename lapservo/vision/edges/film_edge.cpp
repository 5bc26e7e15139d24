#include "lapservo/vision/edges/film_edge.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "lapservo/core/statistics.h"

namespace lapservo::internal {
namespace {

// Least squares: step = at_zero + slope * facing.
struct FadingLine {
  double at_zero = 0, slope = 0, variance = std::numeric_limits<double>::infinity();
  double count = 0, mean_square_lever = 0;  // of at_zero's error
};

// For the points that the line before has as inliers.
FadingLine fading_line(std::span<const FadingPoint> points, const FadingLine& before) {
  constexpr double inlier_sigmas = 3, least_spread = std::numeric_limits<double>::epsilon();
  double x = 0, y = 0, xx = 0, xy = 0, yy = 0;
  FadingLine line;
  for (const FadingPoint& p : points) {
    const double off = p.step - before.at_zero - before.slope * p.outside_facing;
    if (off * off > inlier_sigmas * inlier_sigmas * before.variance) continue;
    line.count += 1;
    x += p.outside_facing, y += p.step;
    xx += p.outside_facing * p.outside_facing, xy += p.outside_facing * p.step, yy += p.step * p.step;
  }
  const double n = line.count, middle = x / n, spread = std::max(least_spread, xx / n - middle * middle);
  line.slope = (xy - middle * y) / (n * spread);
  line.at_zero = y / n - line.slope * middle;
  line.variance = std::max(0.0, yy - line.at_zero * y - line.slope * xy) / std::max(1.0, n - 2);
  line.mean_square_lever = 1 + middle * middle / spread;
  return line;
}

}  // namespace

EvenLight even_light_of(std::span<const FadingPoint> points) {
  const FilmEdgeLimits& limits = film_edge_limits;
  if (points.size() < limits.min_fading_points) return {};
  const FadingLine line = fading_line(points, fading_line(points, {}));
  const double whole = line.at_zero + line.slope;
  const double sigma2 = limits.told_even_light_sigma * limits.told_even_light_sigma +
                        line.variance * line.mean_square_lever / (line.count * whole * whole);
  if (!(line.count >= 3 && std::isfinite(sigma2))) return {};
  return {line.at_zero / whole, 1 / sigma2};
}

double usual_or_seen(std::span<const EvenLight> seen) {
  double certainty = 1 / (film_edge_limits.even_light_sigma * film_edge_limits.even_light_sigma);
  double sum = certainty * film_edge_limits.usual_even_light;
  for (const EvenLight& light : seen) certainty += light.certainty, sum += light.certainty * light.fraction;
  return std::clamp(sum / certainty, 0.0, film_edge_limits.most_even_light);
}

double film_edge_light(const Facing& facing, double even_light) {
  const auto lit = [even_light](double cosine) { return even_light + (1 - even_light) * std::max(0.0, cosine); };
  return std::min(lit(facing.film_edge) / lit(facing.outside), film_edge_limits.most_lit);
}

double usual_film_edge_level(const Facing& facing) {
  const double light = film_edge_light(facing, film_edge_limits.usual_even_light);
  return light - (1 - light) * film_edge_limits.darkest_light;
}

EndLight::EndLight(std::span<const EndPoint> points) {
  constexpr double veil_quantile = 0.2;
  EndPoint sum = EndPoint::Zero(), unseen = sum;
  for (const EndPoint& point : points) {
    sum += point;
    for (Eigen::Index c = 0; c < 3; ++c)  // both are 0 where all of a channel is saturated
      if (point.row(c).isZero(0)) unseen.row(c).setConstant(std::numeric_limits<float>::infinity());
  }
  Eigen::Index channel = 0, side = 0;
  (sum + unseen).minCoeff(&channel, &side);
  const Eigen::Vector3f step = sum.col(1) - sum.col(0);
  const float size = std::max(step.norm(), std::numeric_limits<float>::min());
  const float darkest = static_cast<float>(film_edge_limits.darkest_light) * step.cwiseAbs().maxCoeff() / size;
  step_ = (step / size).cast<double>();
  shaft_ = ((sum.col(0).array() - sum(channel, side)) / size + darkest).cast<double>();
  InplaceVector<float, max_end_points> steps, specular;
  for (const EndPoint& point : points) {
    const float own = std::max(step.dot(point.col(1) - point.col(0)) / size, std::numeric_limits<float>::min());
    steps.push_back(own);
    specular.push_back(point(channel, side) - darkest * own);
  }
  const float veil = points.empty() ? 0 : quantile(InplaceVector(specular), veil_quantile);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double beyond = std::max(0.0F, specular[i] - veil) / steps[i];
    gloss_.push_back(std::min(beyond, film_edge_limits.most_gloss));
  }
}

double EndLight::level(double light, std::size_t point, std::size_t channel) const {
  const auto c = static_cast<Eigen::Index>(channel);
  if (std::abs(step_[c]) < film_edge_limits.darkest_light) return matt_level(light) - gloss_level(point);
  return light - ((1 - light) * shaft_[c] + gloss_[point]) / step_[c];
}

// A step of the same blur, by least squares: the fraction f of the width w solves (1 - s) P(f w) + s P((f - 1) w) = 1/2
// with P the integral of a Gaussian of sqrt(2) blurs, to third order in w; what bounds that is fitted to the whole
// solution, to 2 % up to w = 2 and s = 2.7. Beyond three blurs the series means nothing; the fraction changes little.
FilmShift film_shift(double level, double width_blurs) {
  constexpr double variance = 2, bound = 0.175, widest = 3;
  if (width_blurs > widest) {
    const double fraction = film_shift(level, widest).fraction;
    return {fraction, fraction};
  }
  const double square = width_blurs * width_blurs;
  const double bend = level * (1 - level) * (2 * level - 1) / (6 * variance);
  const double bounded = bound * std::max({0.0, level * level - 1, (1 - level) * (1 - level) - 1});
  const double less = 1 / (1 + bounded * square);
  return {level + bend * square * less, level + bend * square * (3 + bounded * square) * less * less};
}

}  // namespace lapservo::internal
