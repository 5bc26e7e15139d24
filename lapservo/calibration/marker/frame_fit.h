#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "lapservo/calibration/fit/at_iteration.h"
#include "lapservo/core/departures.h"

namespace lapservo::internal {

/// Residuals at x: a column a frame, a row a channel (what is measured in every frame), in the measurements' own
/// standard deviations. Columns of frames that x leaves without a prediction are zero.
using FrameResiduals = std::function<Eigen::MatrixXd(const Eigen::VectorXd& x)>;

struct FrameFit {
  Eigen::VectorXd x;
  Eigen::MatrixXd covariance;   ///< of x, as the residuals scatter
  Eigen::MatrixXd independent;  ///< of x, if no residual went with another: the inverse of the information
  Eigen::MatrixXd residuals;    ///< at x
  Eigen::VectorXd scales;       ///< of each channel: its residuals' robust standard deviation
  Departures departures;        ///< by the numbers that were held
};

/// One number of x before the fit.
struct Unknown {
  double start = 0;
  double step = 1e-4;  ///< by how much it is varied for the derivatives
  double prior = 0;    ///< standard deviation about 0 of what is known beforehand; 0: nothing is
};

/// Numbers of x that belong together. Block::of() an x is theirs, of a covariance theirs among each other.
struct Block {
  Eigen::Index first = 0, size = 0;

  auto of(const Eigen::VectorXd& x) const { return x.segment(first, size); }
  auto of(const Eigen::MatrixXd& covariance) const { return covariance.block(first, first, size, size); }
};

/// Appends numbers that belong together.
Block add_block(std::vector<Unknown>& unknowns, const std::vector<Unknown>& added);

/// Least squares over frames with Cauchy's loss (Ceres). Channels are weighed by their own scatter. The covariance
/// holds for residuals that stay alike over `alike_frames` neighbouring ones (Newey and West 1987). The last
/// `held` unknowns stay as they start and are no part of x and the covariances. `alike`: of each channel, the part of a
/// frame's standard deviation that may be alike in frames that show the same; it keeps faults from being clear. Nullopt
/// when the solver fails or the residuals leave a number open.
std::optional<FrameFit> fit_frames(const FrameResiduals& residuals, const std::vector<Unknown>& unknowns,
                                   std::size_t alike_frames, const AtIteration& at_iteration = {}, std::size_t held = 0,
                                   const Eigen::VectorXd& alike = {});

/// Times sigma: what goes with the pose (the side of the marker that is seen, a codec's habits) is neither noise nor
/// common to all frames, and in no covariance. On rendered motions it doubles the errors (docs/notes/decisions.md).
inline constexpr double unmodelled_sigmas = 2;

}  // namespace lapservo::internal
