#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "lapservo/rcm/line_observation.h"

namespace lapservo {

/// Whether the lines' covariances are absolute, or only their proportions are valid.
enum class NoiseScale {
  known,      ///< chi2 then tests them: beyond chance, the factor is estimated
  estimated,  ///< one factor for all is estimated from how badly the lines meet
};

struct RcmOptions {
  NoiseScale scale = NoiseScale::estimated;
  /// One sigma of an error that all lines share: of their from ends together, and of their to ends, across the lines.
  /// It does not average out and does not show in how well the lines meet (the light, the lens, the print). Finite and
  /// not negative, else the estimate is refused by an InputError.
  double common_px = 0;
};

enum class RcmStatus {
  ok,
  too_few_lines,  ///< fewer than two usable lines
  parallel,       ///< where the lines meet is less certain than their distance from there, or they don't meet
  not_converged,
};
std::string_view to_string(RcmStatus status);

/// The projected RCM; all but status and lines is meaningful only when status is ok.
struct RcmEstimate {
  RcmStatus status = RcmStatus::too_few_lines;
  Eigen::Vector2d point_px = Eigen::Vector2d::Zero();  ///< ideal pixels, anywhere in the image plane
  /// One sigma squared; absent when the noise is to be estimated and two lines leave nothing to do so from.
  std::optional<Eigen::Matrix2d> covariance_px2;
  double chi2 = 0;             ///< of the lines used, in units of their covariances as given
  int degrees_of_freedom = 0;  ///< lines used - 2
  double noise_factor = 1;     ///< by which the given standard deviations are too small; 1 when known ones hold
  std::vector<bool> used;      ///< per line given: neither unusable nor an outlier
  std::size_t lines = 0;       ///< usable ones
  std::size_t outliers = 0;    ///< of them

  /// Rms angle between the lines used and their mean direction.
  double direction_spread_rad = 0;
  /// The estimate is poor along the lines: their directions spread by less than 3 degrees (an error across the lines
  /// becomes one some 20 times as large along them), or the larger sigma exceeds 5 % of the distance from the observed
  /// points to the estimate.
  bool near_parallel = false;
  /// Faults that show in the lines beyond their noise, one sentence each, the clearest first: the covariance counts
  /// them.
  std::vector<std::string> faults;
};

/// Lines whose directions spread by less are parallel: e0 and e3 are known to no better than this over their distance.
inline constexpr double parallel_rad = 1e-3;
inline constexpr double near_parallel_rad = 0.0524;
inline constexpr double near_parallel_fraction = 0.05;

/// The point that all lines pass through, by weighted total least squares: the end points of every line move, by as
/// little as their covariances allow, until all lines meet. Minimises sum g^2 / (h^T C h) over the point o, where
/// g(o) = (to - from) x (o - from) is the line's equation a u + b v + c, h its gradient by the end points and C their
/// covariance: the maximum-likelihood estimate, to first order in the noise free of the bias that fixed weights have,
/// since the weight of a line (how far o lies beyond its end points) moves with o too.
///
/// Robust from six lines up: starts at the pair's intersection with the least median residual (least median of squares,
/// Rousseeuw 1984), then leaves out lines farther off than 3.5 standard deviations; up to about a third may be wrong.
/// The covariance takes errors, but for the common one, as independent from line to line: consecutive frames of a shaft
/// at rest are one line. Lines are in the order of time: if the point moves, its covariance
/// counts that, too.
RcmEstimate estimate_projected_rcm(std::span<const LineObservation> lines, const RcmOptions& options = {});

}  // namespace lapservo
