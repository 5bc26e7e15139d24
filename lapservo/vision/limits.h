#pragma once

#include <array>
#include <cstddef>

#include "lapservo/vision/coarse_fit.h"

/// The thresholds by which vision decides, one struct a step: unit, reason and what they were measured on. Fractions
/// run from 0 to 1. How finely something is sampled, and how often, stands where it is done. docs/notes/accuracy.md has
/// the sets that are named here (`bench/accuracy.sh`), docs/notes/decisions.md what was tried instead.
namespace lapservo::internal {

/// Which pixels have a colour (color_classes.cpp). Hues of the samples' tissue: red to yellow, vessels violet.
struct ColorLimits {
  double merge_deg = 20;         ///< hues this close are one colour to the camera
  double widest_reach_deg = 34;  ///< no hue reaches further, else tissue and vessels have the marker's colours
  double min_saturation = 0.18;  ///< smoke (--smoke 0.55) leaves a quarter of the print's
  double min_chroma = 22;        ///< of 255: below it noise makes hues, most of all in the dark
};
inline constexpr ColorLimits color_limits;

/// Where a marker may be and which pose to start from (surface_tracker.cpp, coarse_fit.cpp).
struct DetectionLimits {
  int min_samples = 8;        ///< of a blob, on a grid of 8 px: smaller ones leave too few boundaries for a fit
  std::size_t max_blobs = 6;  ///< the largest; bounds the time that tissue with the marker's colours costs

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
  double rival_apart_radii = 1;  ///< two places nearer than this are one

  /// From the last frame, and a second time from a pose that is good to a few pixels.
  CoarseFitOptions from_memory{.along_reach = 0.2, .rounds = 1, .search_rotation = false};
  CoarseFitOptions near_by{.lateral_reach_px = 12, .along_reach = 0.125, .rounds = 1, .search_rotation = false};
};
inline constexpr DetectionLimits detection_limits;

/// What the steps of a search cost, in units of work (work_budget.h). A unit is 0.44 us of a core that copies a frame
/// of 1920x1080 in 0.125 ms. Measured in the sequences of bench/hard_frames at that size, each step the least of four
/// replays: of what a frame has few of, the 90th percentile; of what it has hundreds of, the mean of the frames with
/// most of them. What a step took is spent; what must be left for it to begin is what most take.
struct SearchCosts {
  double coarse_fit = 320, no_coarse_fit = 160;  ///< one that found the shaft; one that did not
  double fine_pass = 180, fine_end = 160;        ///< of a fine fit; when it converged, the print and its validation
  double processing = 2400;                      ///< where the first guess at a camera's processing is not enough
  double departure = 150;                        ///< whether the camera departs from the rig's
  double initial_poses = 330;                    ///< of one blob
  double no_initial_poses = 15;                  ///< of one in which there are none
  double bands_in_order = 90, rcm_starts = 900;  ///< the same, by lines through the RCM
  double agreement = 12;                         ///< of one pose with the frame's colours
  double blobs_per_px = 2.2e-4;
  double part_beside = 0.6;  ///< of the budget where every sample is asked whether another instrument hides it
  double cover = 1300;       ///< where one instrument lies, for who looks for another beside or behind it
  double starts_through_rcm(bool beside_others) const { return beside_others ? 2 * rcm_starts : rcm_starts; }
  double fine_fit() const { return 3 * fine_pass + fine_end; }
  double try_start() const { return coarse_fit + fine_fit(); }
  double fit_to_result() const { return 150 * agreement + fine_fit(); }
};
inline constexpr SearchCosts search_costs;

/// When a free fit overrules camera_from_rcm, and what is said of q then (surface_tracker.cpp).
struct RegistrationLimits {
  double well_seen_fraction = 0.7;   ///< of the boundary points: hidden ones leave free fits that are wrong
  double max_print_fraction = 0.25;  ///< of psi's variance: a print that is off contradicts any registration
  /// Between the fitted axis and the line from the RCM, where q is still given, with this angle in its sigma.
  double max_mismatch_rad = 0.03;
};
inline constexpr RegistrationLimits registration_limits;

/// Which points of edges count, and for how much (edge_measurements.cpp).
struct EdgeLimits {
  int min_lines = 12;       ///< generatrices of a pass
  double line_reach = 0.9;  ///< of the visible half width: beyond, light and resolution are gone
  /// What the model leaves out (shading across the blur, lens, print) of every single boundary point; twice that of
  /// sides.
  double single_floor_px = 0.04;
  double interpolation_noise = 1.6;  ///< of the variance: interpolated samples are smoother than pixels are noisy
  /// Beyond it blur is motion's or defocus', no lens's, and what it does to boundaries is modelled
  /// (blurred_boundary.h). Misplaced sides look wide, so boundaries must be wide, too, or the sides by more than a pass
  /// makes of usual ones.
  double wide_blur_px = 1.5, wide_along_blur_px = 1.3, wide_sides_px = 2.1;
  /// These are of shafts of this radius and thicker ones. Thinner ones are moved by more, as the blur's square by the
  /// radius beyond this.
  double unmoved_blur_px = 1.2, thick_radius_px = 36;
  /// Of wide blur, what is the sharpest lens's: what a lens does beyond makes the correlation smaller, which is fitted,
  /// and nothing makes it larger than 1.
  double lens_blur_px = 0.8;
  double blurred_ambient_fraction = 0.05;  ///< of the light on the shaft, the even part
  /// Lines end so many blurs before a side, of which the blur would mix the outside in, and no nearer to the middle.
  double blurs_from_side = 2.5, least_line_reach = 0.6;
  double min_normal_cosine = 0.3;  ///< between the boundary's normal and the line that is sampled
  double max_side_sigma_px = 2;    ///< a side less certain says nothing
  std::size_t min_alike = 3;       ///< points whose colours agree, for what a boundary's change of light is
  std::size_t min_side_edges = 4;  ///< for how noisy a side is

  /// A change of light is the boundary's when it is at least this fraction of what most have, and its direction in the
  /// three channels this alike (cosine squared).
  float min_step = 0.25F, least_alike = 0.7F;
  /// And what it leaves at most this fraction of it (squared), beyond what all leave.
  float max_residual = 0.05F;
  int max_residual_variances = 9;  ///< of the typical variance: three sigma

  /// Light on the film's edge, by that on the outside at most: the even fraction (the rest is diffuse, from the
  /// camera), what is usual and one sigma of it; one sigma of what a boundary tells of it (lamps fade with the
  /// distance, and no paper is quite matt), from so many points on.
  double film_most_lit = 3, usual_even_light = 0.1, even_light_sigma = 0.07, most_even_light = 0.4;
  double told_even_light_sigma = 0.03;
  std::size_t min_fading_points = 8;
  /// Light of the bare shaft by the step of light at an end, gloss and veils aside: black plastic reflects 2 to 5 %, a
  /// print's bright channels half. And the gloss there that is believed.
  double bare_shaft_light = 0.04, most_gloss = 0.6;
  /// One sigma of what the film moves a point by: this fraction of its square, by the blur. At the true pose (60
  /// frames, leaning by up to 60 degrees) 0.01 px are left where it is 0.3 px, 0.05 where it is 0.5, 0.06 where it is
  /// 0.9.
  double film_doubt = 0.3;
  double seam_blurs = 2.5, seam_px = 1.5;  ///< boundaries that jump at the seam, this near to it, are left out
  /// Of a blur, and by how much a pass may change it: wider is no edge, and far steps overshoot.
  double min_blur_px = 0.5, max_blur_px = 8, min_blur_change = 0.6, max_blur_change = 1.7;
};
inline constexpr EdgeLimits edge_limits;

/// Robust weights of all fits: the Cauchy loss' scale, and what is no inlier.
inline constexpr double cauchy_scale_sigmas = 2.5, inlier_sigmas = 5;

/// How a fine fit settles and how sure it is (fine_fit.cpp).
struct FineFitLimits {
  /// What the model leaves out (shading across the blur, lens, print) of each boundary and side as a whole: it does not
  /// average over lines. With it error over sigma is 0.7 on the rotation samples, 1.3 on rendered ones (usual).
  double common_boundary_px = 0.007, common_side_px = 0.02;
  /// Of that, what is doubted of a print but not told of the pose. One pose rendered 25 times (16 poses leaning by up
  /// to 20 degrees): psi scatters by 0.21 mrad and is 0.25 mrad off (rms), where a picture says 0.4.
  double untold_boundary_px = 0.004, untold_side_px = 0.01;
  /// And as a fraction of the blur beyond a lens's: defocus and motion do not blur like a Gaussian. All boundaries move
  /// together by more, mostly where the light comes from aside.
  double usual_blur_px = 1.2, common_fraction_of_blur = 0.008, whole_fraction_of_blur = 0.02;
  /// And of the blur's square beyond a lens's, by the shaft's radius: how far sides, which are no steps, are off, and
  /// by how much all boundaries lean alike: what blur does to them where it is not modelled (blurred_boundary.h), and
  /// what the model leaves. Of sharp pictures sides have a blur of usual_side_blur_px.
  double usual_side_blur_px = 1.05, side_of_blur = 1.4, leaning_of_blur = 0.4, leaning_of_wide_blur = 0.035;
  /// And as a fraction of what the camera's processing moves a boundary by, which is known so well; where colours are
  /// clipped beside boundaries, the larger one. A processing that moves them by doubted_processing_px (rms) doubles the
  /// noise where a hidden boundary's print is asked for, and what `calibrate marker` says.
  double fraction_of_processing = 0.13, fraction_of_clipped = 0.3, doubted_processing_px = 0.1;
  /// By so much of it (rms) sides are off, too, and what is left of all boundaries is moved, leaning and bowed alike,
  /// of which psi feels little: without, phi had up to 2.5 of its sigmas in pictures with 4:2:0, and theta 2.2.
  double side_fraction_of_processing = 0.5, whole_fraction_of_processing = 0.4, leaning_fraction_of_processing = 0.1,
         bowed_fraction_of_processing = 0.3;
  /// And what of that is doubted before the print is blamed: of exact prints 0 to 0.1 px of 0.3 to 0.7 px are left.
  double doubted_of_processing = 0.12;
  /// What even that does not explain of a value, beyond the usual: 0.012 moved boundaries by 0.1 px.
  double usual_misfit = 0.004, px_per_misfit = 8;
  /// Where less than the usual fraction of a marker shows, some of what was taken for its boundaries are the blood's:
  /// sigma grows by so much for all that is missing.
  double usual_fraction = 0.7, doubt_of_hidden = 4;
  /// What single points may be off (EdgeLimits::single_floor_px) is told of the pose as far as their scatter shows it,
  /// of clean frames 0.4 to 0.5 of a sigma; neighbours share pixels, so no less than this, which psi's scatter has
  /// there.
  double least_noise_scale = 0.47;
  double usual_sigma_px = 0.05;  ///< of an edge; compressed ones (--format jpg) have three times that

  /// What is doubted before the print is blamed (PrintDoubt): by what is beyond the usual sigma of an edge, by the blur
  /// beyond a lens's and by what the processing moved. Residuals of exact prints, each about the pose: boundaries 0.03
  /// px in JPEG, 0.09 in H.264, 0.007 in defocus (2 to 3.2 px); their tilts 0.03, 0.08, 0.05; the marker looks shorter
  /// by 0.5 % in defocus. In the dark and in noise nothing is left of it.
  double doubted_of_sigma = 0.8, doubted_length_of_sigma = 0.1;
  double doubted_tilt_of_blur = 0.025, doubted_length_of_blur = 0.001;
  /// And what a processing that a blurred picture can't tell moves boundaries by.
  double doubted_boundary_of_blur = 0.04;

  double settled_px = 1.5;    ///< a pass that moves no point farther is the last
  double settled_blur = 0.1;  ///< change of the blur, a fraction of it, below which edges need not be located again
  double motion_blur_weight =
      5;  ///< a motion blur's change by that of a point: motion's may be no blur, and never settles
  double settled_oblique_px2 = 0.3;  ///< of a blur's covariance, which moves boundaries by a twentieth of it in px
  double sharp_blur_px = 1.8;        ///< a blur below it may flicker where few sides are left
  double settled_sigmas = 0.01;      ///< a reweighting that moves the unknowns by less is the last
};
inline constexpr FineFitLimits fine_fit_limits;

/// What the boundaries' blur tells of a turn within the exposure (turn_blur.cpp). By rendered turns of 0.05 to 0.4 rad.
struct TurnBlurLimits {
  int min_points = 6;  ///< of a boundary
  /// By how much boundaries' blurs differ in still pictures: of cameras that do nothing to them, and of 4:2:0, JPEG
  /// (0.1 to 0.5).
  double unexplained_px2 = 0.003, of_processing_px2 = 0.3;
  double told_sigmas = 2.5;  ///< from which on a blur is a turn's and no noise: most frames are still
  /// Of the misfit (chi^2 a degree of freedom, of which there are two at most), what is not taken for chance.
  double misfit_fraction = 0.25;
  /// Of what the turn changed by, the most that the middle may be off: twice what a start from rest within this
  /// exposure has.
  double uneven_of_change = 0.5;
};
inline constexpr TurnBlurLimits turn_blur_limits;

/// When a camera's processing is believed (picture_processing.cpp).
struct ProcessingLimits {
  /// By accuracy_study camera 12 3, 69 first guesses of 72 frames without any (none, bayer, ca, crosstalk, rec709,
  /// vignette) lie below these sizes, and of 60 with it (sharpen, chroma420, tone, camera, jpeg) none.
  double chroma_variance_px2 = 0.5, max_sharpening = 0.3, min_sharpening = -0.2, saturation = 0.1;
  double max_blur_px = 1.65;  ///< beyond, motion and defocus are taken for processing, and flat parts are out of reach
  /// Of a value, and of what is left without any processing: blood, highlights and noise are not explained by it (0.87
  /// and more), processing is (0.2 to 0.7).
  double max_misfit = 0.013, max_misfit_fraction = 0.8;
  /// What no processing explains so well has none: 0.002 to 0.006 are left of rendered frames without any (a response
  /// that is Rec. 709's and not the rig's among them, which saturation would explain, wrongly), 0.0035 and
  /// more of those with some. What is taken for none by this is off by little, and sigma holds (0.3 to 0.9).
  double max_misfit_of_none = 0.0048;
  int min_places = 8;  ///< of a boundary, else it tells more noise than shape
  int min_boundaries = 3;
};
inline constexpr ProcessingLimits processing_limits;

/// When a camera is believed to differ from the rig's (camera_departure.cpp).
struct DepartureLimits {
  int reach_px = 4, least_clear_px = 3;  ///< across a boundary
  /// One sigma of where a channel shows a boundary, by its share of the largest change of light: shading and ink move
  /// weak channels, which are left out below a tenth; and of any.
  double sigma_px = 0.02, floor_px = 0.01, least_step = 0.1;
  double farthest_px = 1;  ///< what is farther from the others is no boundary
  /// Magnifications of lenses, beside 1; exponents of responses, too, and by how much the latter are tried.
  double usual_aberration = 2e-3, usual_exponent = 0.3, exponent_step = -0.1;
  /// What no camera has: the border's red and blue 10 px apart, light to the power of 0.5.
  double most_aberration = 0.01, most_exponent = 0.5;
  int least_degrees = 4;
  /// Squared sigmas: of all by which channels disagree, and left a degree where that is explained (at least, by which
  /// gains are told; of a response at most, or it is gloss).
  double least_squares = 2.5, least_scatter = 0.3, most_response_scatter = 0.8;
  /// What one number explains, by the scatter; and of a response, which must be another besides. Of clean pictures with
  /// highlights magnifications gain up to 6.3, of a steep marker with crosstalk 9.6; real ones mostly 15 and more.
  double least_gain = 11, least_response_gain = 5.5, least_exponent = 0.06;
  /// From where on a magnification may be there: highlights gain as much, but leave 0.6 and more (a swing of 72 frames;
  /// magnifications that were not believed 0.1 to 0.25).
  double least_doubted_gain = 4, most_doubted_scatter = 0.4;
  double least_of_others = 0.5;  ///< of an exponent, told without any one of the boundaries
  /// A departure's sigma takes in a part of what is left, most of which is common to all frames (exponents of 53 frames
  /// had a standard deviation of 0.008, for 0.028 by all of it), and of a response a part of itself: it is no power.
  double told_of_scatter = 0.5, told_of_response_scatter = 0.2, doubted_of_response = 0.03;
  double least_told_scatter = 0.2;  ///< of the whole: what two degrees leave may be less by chance
};
inline constexpr DepartureLimits departure_limits;

/// What is assumed of prints that are not the rig's (print_fit.cpp).
struct PrintLimits {
  /// How far a print is off when it is [mm], and how often that is; all others are the rig's. What is seen, and whether
  /// the print is to blame, goes by `fractions`, each about half of the one before: an exact print's sigma grows by a
  /// tenth, and with all sizes alike frames that tell nothing lost 17 % of what was found.
  std::array<double, 8> sigmas_mm{0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64};
  std::array<double, 8> fractions{0.05, 0.025, 0.0125, 0.00625, 0.006, 0.0016, 0.0008, 0.0004};
  /// How sure the pose is goes by these. Nobody prints, cuts and wraps to 5 um: with half of them there, lucky prints
  /// were taken for exact ones (error / sigma 2.06). Blaming the print by these, a focal length that is off by 3 % was
  /// a print that is off.
  std::array<double, 8> told_fractions{0, 0.04, 0.07, 0.03, 0.006, 0.0016, 0.0008, 0.0004};
  /// And whether the picture shows that the print is the rig's goes by these: a third are off, by any size. By the
  /// others a print that is off by 0.1 mm is so rare that one which looks like a turn but for little passed for exact.
  std::array<double, 8> suspected_fractions{0, 0.05, 0.05, 0.05, 0.05, 0.05, 0.05, 0.02};
  /// A print is suspicious where, by these fractions, it is off by far_off_mm and more (psi by 0.04 rad) with such a
  /// probability: 1200 exact prints in sharp, soft (1.6 px), dim and noisy pictures have at most 0.005, in defocus, the
  /// dark and after a camera's processing mostly less than 0.05; of 94 prints that are off by 0.05 to 0.3 mm and were
  /// `ok` without this (of 5400) 74 have more than 0.05. And by how many times that of residuals that are zero it is
  /// so: what a small or compressed picture can't tell is no suspicion.
  double far_off_mm = 0.04, suspicious = 0.02, suspicious_of_usual = 6;
  /// Of such a print's psi sigma is told to be so many times the mean over all sizes': either it is exact or far off.
  double suspected_told = 1.2;
  /// From this size on, inks lie aside. With smaller ones exact prints in small pictures had more sigma, and a wrong
  /// registration was no longer seen.
  double least_ink_aside_mm = 0.06;
  double min_weight = 1e-6, min_suspected_weight = 1e-4;  ///< less is too unlikely to count
  double off_sigmas = 3;  ///< beyond what shows, for how far an inner boundary may be off
};
inline constexpr PrintLimits print_limits;

/// What frames of a run tell of a print (print_record.cpp).
struct PrintRecordLimits {
  /// The rig's: all boundaries on nearly all lines, and at most these of PrintFit::far_off_probability and inner_off_m,
  /// of which exact prints have 1e-5 and 10 um in usual pictures.
  double wholly_located = 0.8, most_far_off = 0.005, most_inner_off_m = 0.03e-3;
  /// From one side that is so near, and two that show much of the same (a camera sees 1 rad to either side).
  double near_rad = 0.6, in_view_rad = 1.2;
  int least_off_sides = 3, off_for_others = 2;  ///< and so many times those from which it may be the rig's
};
inline constexpr PrintRecordLimits print_record_limits;

/// When an inner boundary shows elsewhere than a fit has it (displaced_boundary.cpp). Of 1186 exact prints under 40 %
/// of blood none has a line that says so beyond those that agree; of 771 inks aside that were wrong by 0.1 rad and ok
/// but for the rule about inner boundaries it tells 663.
struct DisplacedLimits {
  double located = 0.7;                                           ///< of the lines: on as many a fit has what shows
  double agreeing_px = 0.5, agreeing_sigmas = 4, tolerances = 3;  ///< at most so far from the fit, it agrees
  double max_sigma_px = 0.5, alike_px = 0.4;                      ///< of points that may show it elsewhere
  int least_lines = 3;
  /// However many agree: exact prints have one such line at most, two of 1200 prints with bands off that were 0.2 rad
  /// wrong, over the seam, have six.
  double clear_sigma_px = 0.12;
  int least_clear_lines = 4;
};
inline constexpr DisplacedLimits displaced_limits;

/// When a fit is good enough to move a robot by (verification.cpp). How far the limits are from what is found: 340 fits
/// taken for ok in 340 rendered frames (usual, dark, blood, smoke, defocus, noise and JPEG of docs/notes/accuracy.md,
/// and --blood 0.4 --seed 71) have, but for one in a hundred each,
///   matching >= 0.44, wrong <= 0.024, beyond <= 0.47, beside <= 0.15, located fraction >= 0.44, rms <= 1.29 sigma,
///   an end on >= 10 lines, sides at >= 14 places, blur <= 2.4 px, sigma of psi <= 18 mrad;
/// half of the 71 fits refused there have matching <= 0.54, located fraction <= 0.50, rms >= 1.6 sigma, sigma >= 33
/// mrad.
struct ValidationLimits {
  double max_sigma_psi_rad = 0.02;        ///< five sigma: a tenth of a radian, from which on psi counts as wrong
  double max_sigma_print_off_rad = 0.01;  ///< where the print is certainly off: how far is known from four numbers
                                          ///< at best, so ten sigma
  double certainly_off = 0.999;           ///< probability
  /// And of psi as it is told, of which prints that are off are more: in defocus and in the dark they show little.
  double max_sigma_told_rad = 0.04;
  /// And of psi where a third of all prints are off (suspected_fractions), if this one is suspicious: an ink that lies
  /// 0.05 mm aside has 12.2 mrad in shafts of the usual radius. Of hidden, moved or strongly compressed markers a
  /// picture tells less: exact prints in H.264 have up to 29 mrad, mostly with residuals of 1.25 to 1.6 sigma.
  double max_sigma_suspected_rad = 0.012, usual_radius_px = 46, max_sigma_suspected_of_poor_rad = 0.03;
  double scattered_rms_sigmas = 1.25, even_blur = 1.3, even_correlation = 0.5;  ///< the latter of defocus
  /// Times what the rig's tolerance_m adds to the variance: who sets it wants to live with it.
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
  /// Fewer lines are enough of an inner boundary beside which both of its colours show, on so many lines.
  int confirmed_lines = 3;
  /// Located fraction above which that is not asked where both inner boundaries show on missed_fraction of their lines.
  double hardly_hidden = 0.75;
  /// A processing that moves a boundary by more scatters points beyond their sigmas: of clipped colours (moved by 0.4
  /// to 0.8 px, JPEG by up to 0.3) 0.55 are located with nothing hidden.
  double scattering_processing_px = 0.35;
  double max_spilled = 0.12;  ///< of the ring beyond an end, with that end's colour: the end is elsewhere
  /// And where both ends are located on so much of their lines (2 of the 18).
  double max_spilled_of_located = 0.2, half_located = 0.4;

  /// How far each inner boundary may lie from where on the print the rig says, three sigma included, unless its bands
  /// were measured. Prints made by hand are off by 0.05 to 0.3 mm; 0.1 mm is a turn of 0.05 to 0.1 rad.
  double max_inner_off_m = 0.09e-3, tolerance_of_prints_m = 0.1e-3;
  /// Where blood leaves an inner boundary less than missed_fraction of its lines, an edge of the blood may be taken for
  /// it, if the true one shows nowhere (displaced_boundary.h): of 6000 inks aside one was wrong by 0.1 rad with 90 um,
  /// none with 70.
  double max_inner_off_of_few_m = 0.07e-3;

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

}  // namespace lapservo::internal
