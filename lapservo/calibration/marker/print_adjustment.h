#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "lapservo/calibration/fit/at_iteration.h"
#include "lapservo/calibration/marker/marker_survey.h"
#include "lapservo/marker/marker.h"

namespace lapservo::internal {

/// The measurable shape of a print: the places of the four boundaries at its upper edge (tau = 0) and at its lower one,
/// from the proximal end at tau = 0, and the gap between the edges.
struct PrintShape {
  std::array<double, 4> upper_m{}, lower_m{};  ///< upper_m[0] is 0
  double gap_rad = 0;

  static PrintShape of(const Marker& marker);
  /// The marker with this print.
  Marker on(Marker marker) const;
};

/// The print's free numbers, in this order: e1, e2, e3 at the upper edge, e0, e1, e2, e3 at the lower edge [m], the gap
/// [rad].
inline constexpr int print_numbers = 8;
using PrintNumbers = Eigen::Matrix<double, print_numbers, 1>;
using PrintCovariance = Eigen::Matrix<double, print_numbers, print_numbers>;

PrintShape changed_by(const PrintShape& shape, const PrintNumbers& change);

/// Standard deviations of the marker's entries that on() writes.
MarkerSigmas sigmas_of(const PrintCovariance& covariance, MarkerSigmas others);

/// The tolerance_m of a rig for this print: the standard deviation of every boundary, at either edge independently,
/// that leaves tau on the centre line as uncertain as the covariance does, over the roll.
double tolerance_of(const PrintShape& shape, const PrintCovariance& covariance, const Marker& marker);

/// An edge of a print that lies off by less than this is where it should be: no gap, no slip, no bow.
inline constexpr double least_edge_m = 0.04e-3;

/// A fault that the model of one print with straight edges leaves out.
struct PrintFault {
  enum class Kind { slips, curved } kind;
  double from_s = 0;  ///< of the first: from when on one edge lies elsewhere along the shaft
  double size = 0;    ///< m: by how much; of the second, how far an edge's middle lies beyond the line of its ends
};

struct AdjustmentOptions {
  double loss_scale_sigmas = 2.5;  ///< of the Cauchy loss
  bool free_print = true;          ///< else poses alone
  bool free_gap = true;
  bool with_covariance = false;
};

/// Changes by one round of a bundle adjustment.
struct Adjustment {
  /// Changes of each frame's pose and, last, of its film in film_sigma_m.
  std::vector<UnknownVector> steps;
  PrintNumbers print = PrintNumbers::Zero();
  /// Residuals that are left, in the order of each frame's edges [px].
  std::vector<std::vector<double>> residuals_px;
  /// How many times what the measurements say of themselves their scatter is; robust.
  double noise_scale = 1;
  std::optional<PrintCovariance> covariance;  ///< of the print, when requested; counts the faults
  std::vector<PrintFault> faults;  ///< that show and are worth a word, the clearest first, with the covariance
  /// The images look compressed and rotate in one direction: the seam may lag by an unknown amount.
  bool lags = false;
};

/// Fits the poses of all frames and one print to measurements near the estimated ones, linearised there, with a robust
/// loss. `film_m` is the film's thickness with which the edges were measured, `marker` the print. Nullopt when the
/// solver fails.
std::optional<Adjustment> adjust(const std::vector<ViewMeasurements>& frames, const Marker& marker,
                                 const AdjustmentOptions& options, const AtIteration& at_iteration = {});

}  // namespace lapservo::internal
