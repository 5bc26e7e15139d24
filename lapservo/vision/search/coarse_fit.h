#pragma once

#include <cstddef>

#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// Which points a coarse fit takes, and when it is one.
struct CoarseFitLimits {
  /// One sigma of a coarse fit's points: colour classes change at a pixel, sides are dark and frayed.
  double side_sigma_px = 2.0, boundary_sigma_px = 1.5;
  double contour_inset_px = 1.0;  ///< the occluding contour is dark: its colour ends inside the true silhouette
  /// How far the first round looks, beyond the predicted silhouettes and, in marker lengths, beyond the ends; the
  /// second half as far.
  double lateral_reach_px = 24, along_reach = 0.25;
  std::size_t min_boundaries = 10;  ///< points, of 52 (four on 13 lines)
  std::size_t min_sides = 4;        ///< points, of 30
  /// A section's stretch of colour by the shaft's expected width: less is blood's remainder, more is tissue's.
  double narrowest_section = 0.5, widest_section = 1.4;

  double least_rcm_sigma_m = 1e-4;  ///< of the RCM: a pixel

  double min_rotation_score = 0.5;  ///< colours that match less those that contradict, at the best rotation
  /// Of the best score: a rotation 0.7 rad and more away that scores higher is as good.
  double rival_ratio = 0.93;
};
inline constexpr CoarseFitLimits coarse_fit_limits;

/// Whether psi is looked for over the full turn, in a second round, or the start's is good enough.
enum class Rotation { unknown, known };

struct CoarseFit {
  bool found = false;  ///< the marker's boundaries were seen well enough for a pose
  PoseUnknowns unknowns;
  double rotation_score = 0;  ///< agreement of colours at the best rotation, 0 to 1; when looked for
  double rival_score = 0;     ///< the best agreement at a quite different rotation

  bool shows_rotation() const { return found && rotation_score >= coarse_fit_limits.min_rotation_score; }
  bool has_rival() const { return rival_score > coarse_fit_limits.rival_ratio * rotation_score; }
};

/// Aligns a pose with the frame's colour classes to about a pixel: the shaft's sides from sections across it, the
/// boundaries from lines along it (segment_line), psi by trying the full turn. Tolerates starts some tens of pixels
/// off.
CoarseFit fit_coarsely(const Scene& scene, PoseUnknowns start, Rotation rotation);

}  // namespace lapservo::internal
