#pragma once

#include <optional>
#include <span>

#include "lapservo/marker/marker.h"
#include "lapservo/vision/common_errors.h"
#include "lapservo/vision/edge_measurements.h"
#include "lapservo/vision/residual_lines.h"
#include "lapservo/vision/shaft_pose.h"

namespace lapservo::internal {

/// A pose, given that the print may lie elsewhere than the rig says: each boundary at either edge of the print (tau = 0
/// and tau -> 2 pi, linear between; the ends are circles). These six errors are normal, independent and alike; large
/// ones have a seventh beside them that both inner boundaries share: an ink that lies aside.
struct PrintFit {
  UnknownVector step;                    ///< to the mean of pose and film, from where the measurements were taken
  UnknownMatrix covariance;              ///< of the pose's unknowns, as it is to be told
  double psi_variance = 0;               ///< by which picture and print are judged
  double off_probability = 0;            ///< that the print is off by more than the tolerance
  double psi_variance_by_tolerance = 0;  ///< of it, what the rig's tolerance adds to an exact print's
  double psi_variance_by_print = 0;      ///< and what the print adds beyond the tolerance
  /// That it is off by print_limits.far_off_mm and more, where many prints are.
  double far_off_probability = 1;
  /// And of one that is suspicious (print_limits), what it adds where many prints are off; else, and of measured bands,
  /// 0.
  double psi_variance_suspected = 0;
  /// How far off the rig's place on the print an inner boundary may lie as a whole, were all others where the rig says:
  /// what the residuals say and three sigma more; of both the worse. Where one is hidden the other's error is a turn,
  /// and nothing shows it: a metre and more.
  double inner_off_m = 3;
};

/// Tells the print's errors from the settled measurements' residuals. How large they usually are is not known, so the
/// pose is a mean over the rig's print and prints that are off by 5 um to 0.6 mm, each weighted by how likely it
/// makes the residuals. On return the residuals are those that the step and the print's likeliest errors leave.
/// `lines` are those of these residuals, `film_prior` as the fit has it. Nullopt when a direction is not seen at all.
std::optional<PrintFit> fit_print(std::span<Measurement> measurements, const ResidualLines& lines, int pose_unknowns,
                                  double film_prior, const Marker& marker, const CommonErrors& errors);

}  // namespace lapservo::internal
