#pragma once

#include <array>
#include <optional>
#include <span>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/vision/edges/edge_measurements.h"
#include "lapservo/vision/model/common_errors.h"
#include "lapservo/vision/model/print_evidence.h"
#include "lapservo/vision/shaft/rcm_prior.h"

namespace lapservo::internal {

/// d(residual)/d(print's errors at its upper and at its lower edge) [px/mm].
inline Eigen::Vector2d print_row(const Measurement& m) {
  const double along = mm_in_m * m.along_px_per_m;
  return {along * (1 - m.turn_fraction), along * m.turn_fraction};
}

using PrintCrossMatrix = Eigen::Matrix<double, print_errors, fit_unknowns>;

/// Normal equations of the pose and film (x) and of the print's errors (n).
struct PrintEquations {
  UnknownMatrix xx = UnknownMatrix::Zero();
  PrintCrossMatrix nx = PrintCrossMatrix::Zero();
  PrintMatrix nn = PrintMatrix::Zero();
  UnknownVector x = UnknownVector::Zero();
  PrintVector n = PrintVector::Zero();

  /// Adds weight * row * row^T, and of the residual.
  void add(const UnknownVector& row_x, const PrintVector& row_n, double weight, double residual) {
    const UnknownVector weighted_x = weight * row_x;
    const PrintVector weighted_n = weight * row_n;
    xx.noalias() += row_x * weighted_x.transpose();
    nx.noalias() += weighted_n * row_x.transpose();
    nn.noalias() += row_n * weighted_n.transpose();
    x += residual * weighted_x;
    n += residual * weighted_n;
  }
};

/// The evidence of a group of measurements together: sums of weighted rows and residuals.
struct GroupPull {
  UnknownVector x = UnknownVector::Zero();
  PrintVector n = PrintVector::Zero();
  double weight = 0, residual = 0, error_px = 0;

  /// Adds a part of a measurement's rows.
  void add(const Measurement& m, double part) {
    x += part * m.row;
    if (m.group >= errors_of_boundary.size()) return;
    const Eigen::Vector2d by_print = print_row(m);
    for (const int edge : {0, 1}) n[errors_of_boundary[m.group][edge]] += part * by_print[edge];
  }
};

/// The effect of one sigma of a number of the rig's camera or marker on the measurements of all groups.
struct CameraPull : GroupPull {
  std::array<double, measurement_groups> by_group{};  ///< sums of weights times what it moves
};

/// For all measurements; what each group says, and what errors do that all boundaries or all groups share.
struct PrintSums {
  PrintEquations equations;
  std::array<GroupPull, measurement_groups> pulls;
  InplaceVector<GroupPull, 3> of_all_boundaries;
  InplaceVector<CameraPull, RigErrors::most> camera;
};

/// Weighted robustly about the errors' lines. `film_prior` as the fit has it.
PrintSums print_sums(std::span<const Measurement> measurements, double film_prior, const CommonErrors& errors);

/// The same of a shaft that is held at the RCM.
PrintSums held(PrintSums sums, const RcmMeasurement& rcm);

/// The residuals' evidence about the print's errors, whatever the pose, the film and the common errors are; none where
/// the frame shows nothing of them.
PrintInformation information_of(const PrintSums& sums);

/// By how much the print's errors move a measurement.
inline double print_shift_px(const Measurement& m, const PrintVector& print_mm) {
  if (m.group >= errors_of_boundary.size()) return 0;
  const auto& errors = errors_of_boundary[m.group];
  return print_row(m).dot(Eigen::Vector2d(print_mm[errors[0]], print_mm[errors[1]]));
}

/// For pose and film, and for the print's errors.
struct PrintSolution {
  UnknownVector step = UnknownVector::Zero();
  PrintVector print_mm = PrintVector::Zero();
  UnknownMatrix inverse = UnknownMatrix::Zero();  ///< of the equations of pose and film
  UnknownMatrix covariance = UnknownMatrix::Zero();
};

/// The likeliest pose when the print's errors are so, and how sure it is. Nullopt when a direction is not seen at all.
std::optional<PrintSolution> solved_with_print(const PrintSums& sums, const PrintPrior& prior);

}  // namespace lapservo::internal
