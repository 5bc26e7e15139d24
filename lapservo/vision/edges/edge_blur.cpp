#include "lapservo/vision/edges/edge_blur.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace lapservo::internal {
namespace {

// Of a motion that blurs beyond what a lens does.
double motion_px(double blur_px) {
  return std::sqrt(std::max(0.0, blur_px * blur_px - blur_limits.lens_blur_px * blur_limits.lens_blur_px));
}

double widest_boundary_px(const EdgeBlur& blur) {
  return *std::max_element(blur.along_px.begin(), blur.along_px.end());
}

}  // namespace

double BlurEllipse::along_normal_px(const Eigen::Vector2d& normal) const {
  const double variance = normal.x() * normal.x() * along_px2 + normal.y() * normal.y() * across_px2 +
                          2 * normal.x() * normal.y() * oblique_px2;
  return std::sqrt(std::max(blur_limits.min_blur_px * blur_limits.min_blur_px, variance));
}

bool EdgeBlur::wide() const {
  const double boundary_px = widest_boundary_px(*this);
  const auto beyond = [&](double blur_px, double of_thick_px) {
    const double unmoved_px2 = blur_limits.unmoved_blur_px * blur_limits.unmoved_blur_px;
    const double thickness = std::min(1.0, radius_px / blur_limits.thick_radius_px);
    return blur_px * blur_px > unmoved_px2 + (of_thick_px * of_thick_px - unmoved_px2) * thickness;
  };
  // Sides alone look wide where they are misplaced.
  return beyond(sides_px, blur_limits.wide_sides_px) ||
         (beyond(boundary_px, blur_limits.wide_along_blur_px) &&
          beyond(std::max(boundary_px, sides_px), blur_limits.wide_blur_px));
}

double EdgeBlur::widest_px() const {
  return std::max(widest_boundary_px(*this), sides_px);
}

BlurEllipse EdgeBlur::ellipse(std::size_t boundary) const {
  const double along = along_px[boundary];
  return {along * along, sides_px * sides_px, correlation * motion_px(along) * motion_px(sides_px)};
}

double BlurEvidence::improved(double blur_px) const {
  if (!(information > 0)) return blur_px;
  return std::clamp(blur_px + gradient / information,
                    std::max(blur_limits.min_blur_px, blur_limits.min_blur_change * blur_px),
                    std::min(blur_limits.max_blur_px, blur_limits.max_blur_change * blur_px));
}

void WideBlurEvidence::add(const EdgeFit& edge, double variance, const EdgeBlur& blur, std::size_t boundary,
                           const Eigen::Vector2d& normal) {
  // Of the blur along the line, whose square is the ellipse's form of (1, tangent).
  const double tangent = normal.y() / normal.x();
  const double line_px = blur.ellipse(boundary).along_normal_px({1, tangent});
  Numbers row = Numbers::Zero();
  row[static_cast<Eigen::Index>(boundary)] = blur.along_px[boundary] / line_px;
  row[4] = tangent * motion_px(blur.along_px[boundary]) * motion_px(blur.sides_px) / line_px;
  gradient_ += edge.blur_gradient / variance * row;
  information_ += edge.blur_information / variance * row * row.transpose();
}

EdgeBlur WideBlurEvidence::improved(const EdgeBlur& blur) const {
  // What is not seen is taken to be as the others, and the correlation to be none.
  auto information = information_;
  Numbers gradient = gradient_;
  for (int k = 0; k < 4; ++k) {
    information(k, k) += 1;
    gradient[k] += blur.boundaries_px - blur.along_px[static_cast<std::size_t>(k)];
  }
  information(4, 4) += 1;
  gradient[4] -= blur.correlation;
  const Numbers step = information.ldlt().solve(gradient);
  if (!step.allFinite()) return blur;
  EdgeBlur next = blur;
  next.boundaries_px = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    next.along_px[k] = BlurEvidence{step[static_cast<Eigen::Index>(k)], 1}.improved(blur.along_px[k]);
    next.boundaries_px += next.along_px[k] / 4;
  }
  next.correlation = std::clamp(blur.correlation + step[4], -1.0, 1.0);
  return next;
}

}  // namespace lapservo::internal
