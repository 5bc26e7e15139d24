#pragma once

#include <array>
#include <optional>

#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/shaft/scene.h"

namespace lapservo::internal {

/// When a boundary shows in two places.
struct TwoMomentsLimits {
  float least_part = 0.15F;     ///< of the boundary's change of colour; a recorder that adds less hardly moves psi
  double apart_px = 6;          ///< the second image is as far away
  std::size_t min_points = 12;  ///< of all boundaries, that are so far away
  double told_for_s = 1;        ///< after a frame that shows it: recorders add frames all the time
  float amid = 0.4F;            ///< of that part, what changes in the middle between both: more is motion blur
};
inline constexpr TwoMomentsLimits two_moments_limits;

/// Whether the marker's boundaries show a second time, weaker or as strong, a step of its motion beside where they were
/// fitted: the frame is the sum of two moments, as the conversion of frame rates and noise reduction over time make it,
/// and the fit may be of either. `before`: where the marker was, or what was taken for it, in the frame before and in
/// the one before that. Only frames in which it moves farther than edges are wide can show it; others take no time.
bool shows_two_moments(const Scene& scene, const FineFit& fit, const std::array<std::optional<ShaftPose>, 2>& before);

}  // namespace lapservo::internal
