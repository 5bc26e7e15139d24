#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>

#include "lapservo/marker/marker.h"
#include "lapservo/vision/edges/edge_measurements.h"
#include "lapservo/vision/model/common_errors.h"
#include "lapservo/vision/shaft/rcm_prior.h"

namespace lapservo::internal {

/// A size of a print's errors (one sigma), and what fraction of prints has it.
struct ErrorSize {
  double mm, fraction;
};

/// Twice the size is half as often: that is assumed of prints made by hand, and no measurement.
template <std::size_t Count>
constexpr std::array<ErrorSize, Count> doubled_sizes(double least_mm) {
  constexpr double fraction_mm = 8e-4;
  std::array<ErrorSize, Count> sizes{};
  for (ErrorSize& size : sizes) size = {least_mm, fraction_mm / least_mm}, least_mm *= 2;
  return sizes;
}

/// Assumptions about prints. A print is the rig's, or its bands are off by one of these sizes; and, whatever its bands
/// are, its middle ink may lie aside by one of these.
struct PrintLimits {
  double off_mm = 0.04;  ///< a print is off by this and more
  std::array<ErrorSize, 7> bands = doubled_sizes<7>(off_mm / 4);
  std::array<ErrorSize, 5> inks = doubled_sizes<5>(off_mm);
  /// Each size from off_mm on of prints that were seen to be the rig's, and each beyond a measured print's sigma.
  double fraction_of_known = 1e-4;
  double min_weight = 1e-6;  ///< of a size that counts
  /// Of the RCM: from the one on misprints are examined, too; from the other on it lies elsewhere.
  double clearly_missed_sigmas = 3, contradicted_sigmas = 5;
};
inline constexpr PrintLimits print_limits;

/// The probability that a normal error of this mean and variance is beyond Observation::false_rad.
double p_false_of(double mean_rad, double variance_rad2);

/// How sure a fit is, whatever the print is.
struct PrintVerdict {
  PoseMatrix covariance = PoseMatrix::Zero();  ///< of the pose's unknowns, one sigma squared
  /// The RCM lies beyond the marker, or contradicted_sigmas and more beside the shaft that the image alone shows.
  bool misses_rcm = false;
  double off_probability = 0;            ///< that the print is off by print_limits.off_mm and more
  double p_false = 1;                    ///< that psi is wrong
  double p_false_by_tolerance = 0;       ///< what the rig's tolerance of the print adds to it
  double psi_variance_by_tolerance = 0;  ///< what the rig's tolerance adds to an exact print's
};

/// A pose, given that the print may lie elsewhere than the rig says: each boundary at either edge of the print (tau = 0
/// and tau -> 2 pi, linear between; the ends are circles).
struct PrintFit : PrintVerdict {
  UnknownVector step;                  ///< to the mean of pose and film, from where the measurements were taken
  UnknownVector step_as_the_rig_says;  ///< the same, of the rig's print
  /// d(the pose's unknowns)/d(RCM in the camera frame) [1/m].
  Eigen::Matrix<double, pose_unknowns, 3> by_rcm_m = Eigen::Matrix<double, pose_unknowns, 3>::Zero();
  bool through_rcm = false;  ///< held at the RCM, which it misses only where it may not be contradicted
};

/// The RCM beside a fit: how far the shaft passes it, whether the passes held it there, and whether the frame shows
/// enough to be fitted without it where it misses it.
struct RcmBesideFit {
  RcmMeasurement measurement;
  bool held_by_passes = false, may_be_contradicted = false;
};

/// Estimates the print's errors from the settled measurements' residuals. How large they usually are is not known, so
/// the pose is a mean over the rig's print and misprints (PrintLimits), each weighted by how likely it makes the
/// residuals. On return the residuals are those that the step and the print's likeliest errors leave. `film_prior` as
/// the fit has it, `is_known`: earlier frames showed that the print is the rig's. Nullopt of a direction that is
/// unseen.
std::optional<PrintFit> fit_print(std::span<Measurement> measurements, const std::optional<RcmBesideFit>& rcm,
                                  double film_prior, const Marker& marker, bool is_known, const CommonErrors& errors);

}  // namespace lapservo::internal
