#include "lapservo/control/frozen_image.h"

#include <cmath>

#include "lapservo/control/tracking_law.h"

namespace lapservo::internal {
namespace {

constexpr double same = 0.02;  // of the feature scales: 0.1 mrad, 0.02 px
// Theta and phi have no backlash worth its name; rho and psi count beyond the widest that is looked for.
const Eigen::Vector4d moved(5e-4, 5e-4, 6e-4, 0.12);
constexpr double max_delay_s = 0.3, delay_step_s = 0.05;

}  // namespace

bool FrozenImage::same_features(const Eigen::Vector4d& features) const {
  const Eigen::Array4d change = feature_error(features, first_->features).cwiseQuotient(scales_.features).array();
  return (change.abs() < same).all();
}

bool FrozenImage::add(const ImageMeasurement& image, const JointHistory& history) {
  if (!first_ || !same_features(image.features)) {
    first_ = image;
    return false;
  }
  for (double delay_s = 0; delay_s <= max_delay_s + 1e-9; delay_s += delay_step_s) {
    const auto then = history.at(first_->time_s - delay_s), now = history.at(image.time_s - delay_s);
    if (!then || !now) return false;
    if (((*now - *then).array().abs() <= moved.array()).all()) return false;
  }
  return true;
}

}  // namespace lapservo::internal
