#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/image_measurement.h"
#include "lapservo/control/joint_history.h"

namespace lapservo::internal {

/// Tells a picture that is shown again under a new stamp from one of an instrument that stands still. Of a camera with
/// noise it is the same in every pixel. Else its features are the same to a small part of what noise makes of them, or
/// all its pixels are, while the measured joints moved between the exposures, however long the delay is: so a camera
/// without noise before an arm at rest, or one that just starts, is not taken for frozen, nor a joint that crosses its
/// backlash. Nor is a stream that shows each picture twice, at a multiple of its camera's rate.
class FrozenImage {
 public:
  enum class Verdict {
    fresh,
    again,   ///< the picture before: it tells nothing
    frozen,  ///< and has been so for longer than a stream doubles its pictures
  };
  explicit FrozenImage(const Scales& scales) : scales_(scales) {}

  /// A found image and the measured joints so far.
  Verdict add(const ImageMeasurement& image, const JointHistory& history);

 private:
  static constexpr double delay_step_s = 0.05;
  static constexpr std::size_t delays = 7;                            ///< 0 to 300 ms
  using Joints = std::array<std::optional<Eigen::Vector4d>, delays>;  ///< where they were, were that the delay
  static Joints joints_at(const ImageMeasurement& image, const JointHistory& history);
  bool same_features(const Eigen::Vector4d& features) const;
  bool joints_moved(const ImageMeasurement& image, const JointHistory& history) const;

  Scales scales_;
  std::optional<ImageMeasurement> first_;  // of those that are the same
  bool same_pixels_ = true;                // all of them
  Joints joints_then_;                     // at it: a freeze may last longer than the history
};

}  // namespace lapservo::internal
