#include "lapservo/vision/shaft/scene.h"

#include <algorithm>

namespace lapservo::internal {

std::uint8_t Scene::unless_explained(const Eigen::Vector2d& raw_px, std::uint8_t colour) const {
  return explained_by(others, raw_px, colour) ? outside : colour;
}

bool Scene::hidden_by_others(const Eigen::Vector2d& raw_px, double depth_m) const {
  return std::any_of(others.begin(), others.end(), [&](const ShaftCover* other) {
    return other->hides(raw_px.x() + 0.5, raw_px.y() + 0.5, depth_m);
  });
}

}  // namespace lapservo::internal
