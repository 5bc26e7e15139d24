#pragma once

#include <cstddef>

#include "lapservo/vision/image/light_image.h"
#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/status.h"

namespace lapservo::internal {

/// When a fit is good enough to move a robot by. That psi is right, sigma and p_false say; what they can't know is
/// whether it is the marker that was fitted. How many wrong ones pass: docs/notes/accuracy.md, "False accepts".
struct ValidationLimits {
  double max_sigma_psi_rad = 0.03;  ///< a third of what counts as wrong
  double certainly_off = 0.9;       ///< probability from which on the print is to blame
  /// Times what the rig's tolerance_m adds to the variance and to p_false: who sets it wants to live with it.
  double tolerance_slack = 1.5;
  double wholly_in_image = 0.98;  ///< of the visible surface: what is missing is hidden, not cut
  double min_matching = 0.3;      ///< of the samples on the marker, with their band's colour
  double max_wrong = 0.05;        ///< of them, with another band's
  double max_beyond = 0.5;        ///< of the samples just beyond an end, with the colour of its band
  int min_lines = 6;              ///< on which the inner boundaries are located, and the ends; without the RCM each end
  /// Of a boundary's lines in clear view: located on fewer, it is not where it should be.
  double missed_fraction = 0.3;
  /// Wrong fits agree with few boundaries or sides, and badly; blood leaves few, which agree well; compression leaves
  /// many, noisy. So the boundaries' mean square may grow with the located fraction. Half of the sides is enough.
  double max_rms_sigmas = 2.2, enough_of_sides = 0.5;
};
inline constexpr ValidationLimits validation_limits;

/// How well the frame's colours agree with the marker at a pose, over a grid of its visible surface.
struct ColourAgreement {
  double matching = 0;  ///< fraction of the samples inside the image that have the predicted colour
  double wrong = 0;     ///< fraction that has another of the marker's colours
  double beyond = 0;    ///< of the samples just beyond an end, the fraction on which its band goes on; of the worse end
  double in_image = 0;  ///< fraction of the visible surface that lies inside the image
};
ColourAgreement colour_agreement(const Scene& scene, const ShaftPose& pose, const EdgeBlur& blur = {});

/// On how many of so many lines along the marker nothing hides a boundary: colours of the marker, whichever, show on
/// both sides, of an end inside.
int lines_in_clear_view(const Scene& scene, const ShaftPose& pose, std::size_t boundary, int lines);

/// Whether a fit is good enough to move a robot by: Status::ok, or why not.
Status validate(const Scene& scene, const FineFit& fit);

/// When an inner boundary shows elsewhere than a fit has it.
struct DisplacedLimits {
  double agreeing_px = 0.5, agreeing_sigmas = 4;  ///< at most so far from the fit, a point agrees with it
  double max_sigma_px = 0.5, alike_px = 0.4;      ///< of points that show it elsewhere, together
  int min_lines = 3;                              ///< that show it there
};
inline constexpr DisplacedLimits displaced_limits;

/// Whether it is worth while: an inner boundary is not located on many lines.
bool may_be_displaced(const FineFit& fit);

/// Whether such a boundary shows beside where the fit has it, farther away than a fit's last passes look, on more lines
/// than agree with the fit: what was taken for it is an edge of blood, and the print not the rig's. Looks at the edges
/// once more.
bool is_displaced(const Scene& scene, const LightImage& light, const FineFit& fit);

}  // namespace lapservo::internal
