#include "lapservo/vision/edges/edge_blur.h"

#include <algorithm>
#include <cmath>

namespace lapservo::internal {
namespace {

// For a motion that blurs beyond what a lens does.
double motion_px(double blur_px) {
  return std::sqrt(std::max(0.0, blur_px * blur_px - blur_limits.lens_blur_px * blur_limits.lens_blur_px));
}

}  // namespace

double BlurEllipse::along_normal_px(const Eigen::Vector2d& normal) const {
  const double variance = normal.x() * normal.x() * along_px2 + normal.y() * normal.y() * across_px2 +
                          2 * normal.x() * normal.y() * oblique_px2;
  return std::sqrt(std::max(blur_limits.min_blur_px * blur_limits.min_blur_px, variance));
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

void EllipseEvidence::add(const EdgeFit& edge, double variance, const EdgeBlur& blur, std::size_t boundary,
                          const Eigen::Vector2d& normal) {
  // The blur along the line, whose square is the ellipse's form of (1, tangent).
  const double tangent = normal.y() / normal.x();
  const double line_px = blur.ellipse(boundary).along_normal_px({1, tangent});
  Numbers row = Numbers::Zero();
  row[static_cast<Eigen::Index>(boundary)] = blur.along_px[boundary] / line_px;
  row[4] = tangent * motion_px(blur.along_px[boundary]) * motion_px(blur.sides_px) / line_px;
  gradient_ += edge.blur_gradient / variance * row;
  information_ += edge.blur_information / variance * row * row.transpose();
}

EllipseEvidence::Step EllipseEvidence::step_from(const EdgeBlur& blur) const {
  // Blur that is not seen is taken to be as the others', and the correlation to be none.
  const double mean_px = blur.boundaries_px();
  Information information = information_;
  Numbers gradient = gradient_;
  information.diagonal().array() += 1;
  for (int k = 0; k < 4; ++k) gradient[k] += mean_px - blur.along_px[static_cast<std::size_t>(k)];
  gradient[4] -= blur.correlation;
  const Eigen::LDLT<Information> factor(information);
  return {factor, factor.solve(gradient)};
}

EdgeBlur EllipseEvidence::improved(const EdgeBlur& blur) const {
  const Numbers change = step_from(blur).change;
  if (!change.allFinite()) return blur;
  EdgeBlur next = blur;
  for (std::size_t k = 0; k < 4; ++k)
    next.along_px[k] = BlurEvidence{change[static_cast<Eigen::Index>(k)], 1}.improved(blur.along_px[k]);
  next.correlation = std::clamp(blur.correlation + change[4], -1.0, 1.0);
  return next;
}

EllipseEvidence::Squares EllipseEvidence::squares(const EdgeBlur& blur) const {
  const auto [information, change] = step_from(blur);
  const Information covariance = information.solve(Information::Identity());
  const Eigen::Map<const Eigen::Vector4d> along_px(blur.along_px.data());
  const Eigen::Vector4d twice_px = 2 * along_px;
  return {along_px.cwiseAbs2() + twice_px.cwiseProduct(change.head<4>()),
          twice_px.asDiagonal() * covariance.topLeftCorner<4, 4>() * twice_px.asDiagonal()};
}

}  // namespace lapservo::internal
