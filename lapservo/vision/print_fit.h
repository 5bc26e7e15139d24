#pragma once

#include <optional>
#include <span>

#include "lapservo/vision/edge_measurements.h"
#include "lapservo/vision/shaft_pose.h"

namespace lapservo {

/// Errors that all measurements of a group share (one sigma), and by how much all noise is larger than each
/// measurement says.
struct CommonErrors {
  double boundary_px = 0, side_px = 0, noise_scale = 1;
};

/// What frames say about the print's errors: their standard deviation, and how many degrees of freedom tell it. Carried
/// from frame to frame, for the print stays as it is.
struct PrintEvidence {
  double sigma_m = 0, degrees = 0;
};

/// A pose, given that the print may lie elsewhere than the rig says: each boundary at either edge of the print (tau = 0
/// and tau -> 2 pi, linear between), and the radius. These nine errors are normal, independent and alike.
struct PrintFit {
  double sigma_m = 0;        ///< of each of the nine: what the frame says (with what it leaves open), or the tolerance
  PrintEvidence evidence;    ///< with that of the frames before
  UnknownVector step;        ///< to the pose and film that are likeliest then, from where the measurements were taken
  UnknownMatrix covariance;  ///< of the pose's unknowns
  double psi_variance_by_tolerance = 0;  ///< of it, what the rig's tolerance adds to an exact print's
  double psi_variance_by_print = 0;      ///< and what the print adds beyond the tolerance
};

/// Tells the print's errors from the settled measurements' residuals: sigma_m maximises the marginal likelihood and is
/// then widened as a t distribution is, since few degrees of freedom tell it (a turn and a shift explain others). Where
/// the rig's print explains what is seen, sigma_m is `tolerance_m`. On return the residuals are those that the step and
/// the print's likeliest errors leave. `film_prior` as the fit has it. Nullopt when a direction is not seen at all.
std::optional<PrintFit> fit_print(std::span<Measurement> measurements, int pose_unknowns, double film_prior,
                                  double tolerance_m, const CommonErrors& errors, const PrintEvidence& before);

/// Root mean square of the boundaries' residuals in sigmas, each about its own straight line over the print; outliers
/// do not count.
double scatter_sigmas(std::span<const Measurement> measurements);

}  // namespace lapservo
