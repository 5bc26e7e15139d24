#pragma once

#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/status.h"

namespace lapservo::internal {

/// When a fit is good enough to move a robot by. How far the limits are from what is found: 340 fits
/// taken for ok in 340 rendered frames (usual, dark, blood, smoke, defocus, noise and JPEG of docs/notes/accuracy.md,
/// and --blood 0.4 --seed 71) have, but for one in a hundred each,
///   matching >= 0.44, wrong <= 0.024, beyond <= 0.47, beside <= 0.15, located fraction >= 0.44, rms <= 1.29 sigma,
///   an end on >= 10 lines, sides at >= 14 places, blur <= 2.4 px, sigma of psi <= 18 mrad;
/// half of the 71 fits refused there have matching <= 0.54, located fraction <= 0.50, rms >= 1.6 sigma, sigma >= 33
/// mrad.
struct ValidationLimits {
  double max_sigma_psi_rad = 0.02;  ///< five sigma: a tenth of a radian, from which on psi counts as wrong
  /// And of psi as it is told, with what one side alone or a turn within the exposure add.
  double max_sigma_told_rad = 0.04;
  double certainly_off = 0.9;  ///< probability from which on the print is to blame
  /// Times what the rig's tolerance_m adds to the variance and to p_false: who sets it wants to live with it.
  double tolerance_slack = 1.5;
  double well_seen_fraction = 0.7;  ///< of the boundary points, to blame the print

  /// A boundary that lies too far from its place is not located at all; where nothing hides the marker, that is the
  /// print. Missed: below this fraction of its lines in clear view, of which there are enough.
  double unhidden_matching = 0.85, missed_fraction = 0.3, unblurred_px = 1.8;
  int enough_lines = 10;

  double min_in_image = 0.25;  ///< of the visible surface
  double wholly_in_image = 0.98;
  /// Of the samples on the marker, those with their colour; those with another band's; and of the places just beyond
  /// the ends and beside the sides, those with a marker's colour.
  double min_matching = 0.3, max_wrong = 0.05, max_beyond = 0.5, max_beside = 0.2;
  /// Where all boundaries show as they should, other colours are noise, of which the dark has plenty under a high gain:
  /// a right fit that is refused gives way to a wrong one with fewer of them.
  double complete_matching = 0.6, complete_fraction = 0.9, tolerance_of_complete = 1.6;
  double blurred_px = 1.5, min_guard = 0.02;  ///< about boundaries colours mix: so far, and this fraction of the length

  /// Lines on which an inner boundary is located, both together, and an end: so many and this fraction of all lines.
  int min_inner = 6, inner_one_in = 10, min_outer = 4;
  /// Each end's, where both are needed: without the RCM they alone fix the depth and with it everything else.
  int min_of_end = 6, end_one_in = 12;
  double mostly_hidden = 0.5, partly_hidden = 0.7;  ///< located fractions, below which more is asked
  /// Where another instrument hides a part, both ends are asked for unless nearly all of the rest is located: blood or
  /// a print that is off may be what is missing.
  double well_located_beside_another = 0.85;
  /// And where another's colours may lie beside a marker, they are no reason to doubt one that shows so well.
  double matching_among_others = 0.7, located_among_others = 0.8;
  /// With the RCM an end may be hidden where more than less_hidden is located in all, and of their lines well_located
  /// of each inner boundary and wholly_located of the other end (4 of the 18 that were missed of --blood 0.4, seeds 71
  /// and 72: right by 5 mrad).
  double less_hidden = 0.4, well_located = 0.25, wholly_located = 0.9;
  double max_spilled = 0.12;  ///< of the ring beyond an end, with that end's colour: the end is elsewhere
  /// And where both ends are located on so much of their lines (2 of the 18).
  double max_spilled_of_located = 0.2, half_located = 0.4;

  /// Wrong fits agree with few boundaries or sides, and badly; blood leaves few, which agree well; compression leaves
  /// many, noisy. So the boundaries' rms may grow with the located fraction, where more than a quarter of the sides
  /// show.
  double min_fraction = 0.2;
  double max_rms_of_all_sigmas = 1.45;  ///< where all boundaries show on missed_fraction of their lines
  double max_rms_sigmas = 1.3, rms_per_fraction = 5.5, rms_from_fraction = 0.7, rms_most_fraction = 0.2;
  int sides_one_in = 4;

  /// Motion over 15 px in an exposure gave psi off by 0.1 rad and more with sigmas of 5 mrad (6 wrong of 117, moving
  /// frames with --motion 0.4 --seed 9). Beyond motion_blurred_px sides hold the shaft's place no more, and an end that
  /// most lines miss is not hidden: what they found is another. Beyond lost_px the motion blur's form, which nobody
  /// knows, decides where the edges are taken to be (an even motion of 14 px is fitted by 4.8 px).
  double motion_blurred_px = 2, lost_px = 5;
  int min_sides = 8;
  int motion_blurred_end_parts = 3, motion_blurred_end_of = 5;  ///< every boundary on three lines of five
};
inline constexpr ValidationLimits validation_limits;

/// How well the frame's colours agree with the marker at a pose, over a grid of its visible surface.
struct ColourAgreement {
  double matching = 0;  ///< fraction of the samples inside the image that have the predicted colour
  double wrong = 0;     ///< fraction that has another of the marker's colours
  double in_image = 0;  ///< fraction of the visible surface that lies inside the image
  double beyond = 0;    ///< fraction of the shaft just beyond both ends that has a marker's colour
  double beside = 0;    ///< fraction of the places just outside both sides that has a marker's colour
  double spilled = 0;   ///< fraction of the ring just beyond an end that has that end's colour, of both the larger
};
ColourAgreement colour_agreement(const Scene& scene, const ShaftPose& pose);

/// Enough of the boundary points are located to blame the print or the registration.
bool is_well_seen(const FineFit& fit);

/// Whether psi is hardly ever wrong, whatever the print is; what the rig's tolerance makes of it does not count.
bool has_right_psi(const Scene& scene, const FineFit& fit);

/// Whether sigma of psi, as it is told, is small enough to be of use.
bool tells_psi(const FineFit& fit);

/// Whether a fit is good enough to move a robot by: Status::ok, or why not.
Status validate(const Scene& scene, const FineFit& fit);

}  // namespace lapservo::internal
