#pragma once

#include "lapservo/vision/coarse_fit.h"
#include "lapservo/vision/fine_fit.h"
#include "lapservo/vision/observation.h"
#include "lapservo/vision/scene.h"

namespace lapservo::internal {

/// How well the frame's colours agree with the marker at a pose, over a grid of its visible surface.
struct ColorAgreement {
  double matching = 0;  ///< fraction of the samples inside the image that have the predicted colour
  double wrong = 0;     ///< fraction that has another of the marker's colours
  double in_image = 0;  ///< fraction of the visible surface that lies inside the image
  double beyond = 0;    ///< fraction of the shaft just beyond both ends that has a marker's colour
  double beside = 0;    ///< fraction of the places just outside both sides that has a marker's colour
  double spilled = 0;   ///< fraction of the ring just beyond an end that has that end's colour, of both the larger
};
ColorAgreement color_agreement(const Scene& scene, const ShaftPose& pose);

/// Whether colours of the marker may lie beyond its ends and beside its sides.
enum class Surroundings {
  empty,    ///< but for a few
  anothers  ///< may be full of another instrument's marker, which nobody has found yet
};

/// Whether a fit is good enough to move a robot by: Status::ok, or why not.
Status validate(const Scene& scene, const FineFit& fit, Surroundings surroundings = Surroundings::empty);

/// Whether a print that is off would show in what is left of a marker, or is known to be the rig's. Where much is
/// hidden one boundary may hold psi, and a print's error looks like a turn.
bool knows_the_print(const Scene& scene, const FineFit& fit);

/// Whether a fit shows the print to be the rig's, for the frames to come.
bool shows_the_print(const FineFit& fit);

/// Whether a fit that is not good enough would be, of a marker that shows well, if another instrument's lay beside it.
bool convinces_beside_another(const Scene& scene, const FineFit& fit);

}  // namespace lapservo::internal
