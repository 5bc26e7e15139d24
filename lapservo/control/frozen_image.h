#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/image_measurement.h"
#include "lapservo/control/joint_history.h"

namespace lapservo::internal {

/// Distinguishes an image that arrives again under a new stamp from an image of an instrument at rest. An image of a
/// camera with noise repeats if it is the same in every pixel. Otherwise it repeats if its features are the same to a
/// small part of their noise, or all its pixels are, while the measured joints moved between the exposures, whatever
/// the delay: a camera without noise before an arm at rest, an arm that just starts and a joint that crosses its
/// backlash are not taken for frozen. A stream that repeats each image, at a multiple of its camera's rate, is not
/// frozen either.
class FrozenImage {
 public:
  enum class Verdict {
    fresh,
    again,   ///< the previous image: it carries no information
    frozen,  ///< repeated for longer than a stream repeats its images
  };
  explicit FrozenImage(const Scales& scales) : scales_(scales) {}

  /// A found image and the measured joints so far.
  Verdict add(const ImageMeasurement& image, const JointHistory& history);

 private:
  static constexpr double delay_step_s = 0.05;
  static constexpr std::size_t delays = 7;                            ///< 0 to 300 ms
  using Joints = std::array<std::optional<Eigen::Vector4d>, delays>;  ///< where they were, were that the delay
  static Joints joints_at(const ImageMeasurement& image, const JointHistory& history);
  bool joints_moved(const ImageMeasurement& image, const JointHistory& history) const;

  Scales scales_;
  std::optional<ImageMeasurement> first_;  // of those that are the same
  bool same_pixels_ = true;                // all of them
  Joints joints_then_;                     // at it: a freeze may last longer than the history
};

}  // namespace lapservo::internal
