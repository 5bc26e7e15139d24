#pragma once

#include <optional>

#include <Eigen/Core>

namespace lapservo {

/// Image features on ideal pixels (eq. 12-15). `r_px` is NaN-free: absent when the RCM's image is unknown.
struct Features {
  double s_rad = 0;            ///< atan2(du, dv) of e3 - e0: the signed angle from the image's vertical
  std::optional<double> r_px;  ///< |e0 - o|, o the projected RCM
  double l_px = 0;             ///< |e3 - e0|
  double d_px = 0;             ///< |e2 - e0|
  double cross_ratio = 0;      ///< of |e1 - e0|, |e2 - e1|, |e3 - e2|
};

/// Covariance of four points as one vector, e0 u, v to e3 u, v [px^2].
using EdgesCovariance = Eigen::Matrix<double, 8, 8>;

}  // namespace lapservo
