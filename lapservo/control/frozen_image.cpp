#include "lapservo/control/frozen_image.h"

#include <cmath>

#include "lapservo/control/tracking_law.h"

namespace lapservo::internal {
namespace {

constexpr double same = 0.02;  // of the feature scales: 0.1 mrad, 0.02 px
// Theta and phi have no backlash worth its name; rho and psi count beyond the widest that is looked for.
const Eigen::Vector4d moved(5e-4, 5e-4, 6e-4, 0.12);

}  // namespace

bool FrozenImage::same_features(const Eigen::Vector4d& features) const {
  const Eigen::Array4d change = feature_error(features, first_->features).cwiseQuotient(scales_.features).array();
  return (change.abs() < same).all();
}

bool FrozenImage::add(const ImageMeasurement& image, const JointHistory& history) {
  if (!first_ || !same_features(image.features)) {
    first_ = image;
    joints_then_ = joints_at(image, history);
    return false;
  }
  const Joints joints_now = joints_at(image, history);
  for (std::size_t i = 0; i < delays; ++i) {
    if (!joints_then_[i] || !joints_now[i]) return false;
    if (((*joints_now[i] - *joints_then_[i]).array().abs() <= moved.array()).all()) return false;
  }
  return true;
}

FrozenImage::Joints FrozenImage::joints_at(const ImageMeasurement& image, const JointHistory& history) {
  Joints joints;
  for (std::size_t i = 0; i < delays; ++i) joints[i] = history.at(image.time_s - delay_step_s * static_cast<double>(i));
  return joints;
}

}  // namespace lapservo::internal
