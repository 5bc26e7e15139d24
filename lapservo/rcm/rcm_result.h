#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lapservo/rcm/line_observation.h"

namespace lapservo::internal {

/// An estimate of where an instrument's RCM appears in the image, in ideal pixels, by one of two methods.
struct RcmResult {
  std::string instrument, method, status;  ///< `method`: weighted or pairwise; `status`: RcmStatus's word
  std::size_t lines = 0, outliers = 0;
  std::optional<Eigen::Vector2d> point_px;  ///< empty unless `status` is ok
  std::optional<Eigen::Matrix2d> covariance_px2;
  std::optional<double> noise_px, chi2, spread_rad;
  bool near_parallel = false;
  std::vector<std::string> faults;        ///< RcmEstimate::faults
  std::optional<Eigen::Vector2d> rig_px;  ///< the RCM by the rig's camera_from_rcm
};

/// The weighted total least squares without outliers, and the paper's mean of all intersections (eq. 9). `sigma_px`: of
/// both ends of a line, 0 to estimate it from the residuals; `common_px`: an error that all lines share.
std::array<RcmResult, 2> estimate_rcm(const std::vector<LineObservation>& lines, double sigma_px, double common_px);

/// CSV with a header and a row per result; absent values are empty.
void write_rcm_results(std::ostream& out, const std::vector<RcmResult>& results);

}  // namespace lapservo::internal
