#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/image_measurement.h"
#include "lapservo/control/joint_history.h"

namespace lapservo::internal {

/// Tells a picture that is shown again under a new stamp from one of an instrument that stands still: its features are
/// the same to a small part of what noise makes of them, while the measured joints moved between the exposures, however
/// long the delay is. So a camera without noise before an arm at rest, or one that just starts, is not taken for
/// frozen, nor a joint that crosses its backlash.
class FrozenImage {
 public:
  explicit FrozenImage(const Scales& scales) : scales_(scales) {}

  /// A found image and the measured joints so far. True: it is the picture before.
  bool add(const ImageMeasurement& image, const JointHistory& history);

 private:
  static constexpr double delay_step_s = 0.05;
  static constexpr std::size_t delays = 7;                            ///< 0 to 300 ms
  using Joints = std::array<std::optional<Eigen::Vector4d>, delays>;  ///< where they were, were that the delay
  static Joints joints_at(const ImageMeasurement& image, const JointHistory& history);
  bool same_features(const Eigen::Vector4d& features) const;

  Scales scales_;
  std::optional<ImageMeasurement> first_;  // of those that are the same
  Joints joints_then_;                     // at it: a freeze may last longer than the history
};

}  // namespace lapservo::internal
