#pragma once

#include <cmath>

#include "fuzz/require.h"
#include "lapservo/core/angles.h"
#include "lapservo/vision/observation.h"

namespace lapservo::fuzz {
using namespace internal;

/// The laws of an observation whose status is ok.
inline void require_sound(const Observation& o) {
  if (o.status != Status::ok) return;
  require(o.tau_rad >= 0 && o.tau_rad <= two_pi, "tau is in [0, 2 pi]");
  require(std::isfinite(o.sigma_tau_rad) && o.sigma_tau_rad > 0, "sigma of tau is finite and above 0");
  for (const auto& edges : {o.edges_ideal_px, o.edges_raw_px})
    for (const Eigen::Vector2d& edge : edges) require(edge.allFinite(), "edges are finite");
  const Features& f = o.features;
  for (const double feature : {f.s_rad, f.l_px, f.d_px, f.cross_ratio, f.r_px.value_or(0)})
    require(std::isfinite(feature), "features are finite");
  require(o.camera_from_unrolled.translation.allFinite() && o.camera_from_unrolled.rotation.coeffs().allFinite() &&
              std::isfinite(o.psi_rad),
          "the pose is finite");
  require(o.p_false.value_or(0) >= 0 && o.p_false.value_or(0) <= 1, "p_false is a probability");
  if (o.marker) {
    const Observation::MarkerPose& m = *o.marker;
    require(m.camera_from_marker.translation.allFinite() && m.camera_from_marker.rotation.coeffs().allFinite(),
            "the marker's pose is finite");
    for (const double sigma : {m.sigma_xy_m, m.sigma_z_m, m.sigma_axis_rad, m.sigma_roll_rad})
      require(std::isfinite(sigma) && sigma > 0, "sigmas of the marker's pose are finite and above 0");
  }
  if (!o.rcm) return;
  require(o.rcm->q.vector().allFinite(), "q is finite");
  require(o.rcm->covariance.allFinite() && o.rcm->covariance.diagonal().minCoeff() > 0,
          "variances of q are finite and above 0");
}

}  // namespace lapservo::fuzz
