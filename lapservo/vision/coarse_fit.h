#pragma once

#include "lapservo/vision/scene.h"
#include "lapservo/vision/shaft_pose.h"

namespace lapservo::internal {

struct CoarseFitOptions {
  double lateral_reach_px = 24;  ///< how far beyond the predicted silhouettes the shaft's sides are looked for
  double along_reach = 0.25;     ///< how far beyond the marker's ends boundaries are looked for, in marker lengths
  int rounds = 2;                ///< of measuring and fitting; the rotation is searched in the second
  bool search_rotation = true;   ///< look for psi over the full turn; else start from the given one
};

struct CoarseFit {
  bool found = false;  ///< the marker's boundaries were seen well enough for a pose
  PoseUnknowns unknowns;
  int boundaries_seen = 0;
  double rotation_score = 0;  ///< agreement of colours at the best rotation, 0 to 1; when searched
  double rival_score = 0;     ///< the best agreement at a quite different rotation
};

/// Aligns a pose with the frame's colour classes to about a pixel: the shaft's sides from sections across it, the
/// boundaries from lines along it (segment_line), psi by trying the full turn. Tolerates starts some tens of pixels
/// off.
CoarseFit fit_coarsely(const Scene& scene, PoseUnknowns start, const CoarseFitOptions& options);

}  // namespace lapservo::internal
