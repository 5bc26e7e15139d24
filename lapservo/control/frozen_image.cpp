#include "lapservo/control/frozen_image.h"

#include <algorithm>

#include "lapservo/control/tracking_law.h"

namespace lapservo::internal {
namespace {

constexpr double same = 0.02;  // of the feature scales: 0.1 mrad, 0.02 px
// Theta and phi have no considerable backlash; rho and psi count beyond the widest gap of the search. A tenth of a
// pixel changes some pixels of an image.
const Eigen::Vector4d moved(5e-4, 5e-4, 6e-4, 0.12), moved_by_pixels(1e-4, 1e-4, 6e-4, 0.12);
constexpr double repeated_s = 0.095;  // a camera of 10 images a second in any faster stream

}  // namespace

FrozenImage::Verdict FrozenImage::add(const ImageMeasurement& image, const JointHistory& history) {
  const bool same_pixels = image.repetition != Repetition::none;
  const auto same_features = [&] {
    const Eigen::Array4d change = feature_error(image.features, first_->features).cwiseQuotient(scales_.features);
    return (change.abs() < same).all();
  };
  if (!first_ || !(same_pixels || same_features())) {
    first_ = image;
    same_pixels_ = true;
    joints_then_ = joints_at(image, history);
    return Verdict::fresh;
  }
  same_pixels_ = same_pixels_ && same_pixels;
  // An image from before the first readings has no known joints.
  if (!std::all_of(joints_then_.begin(), joints_then_.end(), [](const auto& q) { return q.has_value(); }))
    joints_then_ = joints_at(image, history);
  const bool known = image.repetition == Repetition::of_a_noisy_camera;
  if (!known && !joints_moved(image, history)) return Verdict::fresh;
  return image.time_s - first_->time_s < repeated_s ? Verdict::again : Verdict::frozen;
}

bool FrozenImage::joints_moved(const ImageMeasurement& image, const JointHistory& history) const {
  const Joints joints_now = joints_at(image, history);
  const Eigen::Array4d enough = same_pixels_ ? moved_by_pixels : moved;
  for (std::size_t i = 0; i < delays; ++i) {
    if (!joints_then_[i] || !joints_now[i]) return false;
    if (((*joints_now[i] - *joints_then_[i]).array().abs() <= enough).all()) return false;
  }
  return true;
}

FrozenImage::Joints FrozenImage::joints_at(const ImageMeasurement& image, const JointHistory& history) {
  Joints joints;
  for (std::size_t i = 0; i < delays; ++i) joints[i] = history.at(image.time_s - delay_step_s * static_cast<double>(i));
  return joints;
}

}  // namespace lapservo::internal
