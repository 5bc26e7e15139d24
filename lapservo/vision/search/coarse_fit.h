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
  double line_reach = 0.74;       ///< of the visible half angle: beyond, bands are too foreshortened and dark
  int min_boundaries = 10;        ///< points, of 52 (four on 13 lines)
  std::size_t min_sides = 4;      ///< points, of 30
  /// A section's stretch of colour by the shaft's expected width: less is blood's remainder, more is tissue's.
  double narrowest_section = 0.5, widest_section = 1.4;

  double min_rotation_score = 0.5;  ///< colours that match less those that contradict, at the best rotation
  /// Of the best score: a rotation 0.7 rad and more away that scores higher is as good.
  double rival_ratio = 0.93;
};
inline constexpr CoarseFitLimits coarse_fit_limits;

struct CoarseFitOptions {
  double lateral_reach_px = 24;  ///< how far beyond the predicted silhouettes the shaft's sides are looked for
  double along_reach = 0.25;     ///< how far beyond the marker's ends boundaries are looked for, in marker lengths
  int rounds = 2;                ///< of measuring and fitting; the rotation is searched in the second
  bool search_rotation = true;   ///< look for psi over the full turn; else start from the given one
};

/// From the last frame, and a second time from a pose that is good to a few pixels.
inline constexpr CoarseFitOptions from_memory{.along_reach = 0.2, .rounds = 1, .search_rotation = false};
inline constexpr CoarseFitOptions near_by{
    .lateral_reach_px = 12, .along_reach = 0.125, .rounds = 1, .search_rotation = false};

struct CoarseFit {
  bool found = false;  ///< the marker's boundaries were seen well enough for a pose
  PoseUnknowns unknowns;
  int boundaries_seen = 0;
  double rotation_score = 0;  ///< agreement of colours at the best rotation, 0 to 1; when searched
  double rival_score = 0;     ///< the best agreement at a quite different rotation

  bool shows_rotation() const { return found && rotation_score >= coarse_fit_limits.min_rotation_score; }
  bool has_rival() const { return rival_score > coarse_fit_limits.rival_ratio * rotation_score; }
};

/// Aligns a pose with the frame's colour classes to about a pixel: the shaft's sides from sections across it, the
/// boundaries from lines along it (segment_line), psi by trying the full turn. Tolerates starts some tens of pixels
/// off.
CoarseFit fit_coarsely(const Scene& scene, PoseUnknowns start, const CoarseFitOptions& options);

}  // namespace lapservo::internal
