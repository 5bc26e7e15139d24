#include "lapservo/servo/image_features.h"

#include "lapservo/kinematics/centre_line.h"
#include "lapservo/kinematics/feature_map.h"

namespace lapservo {
using namespace internal;
namespace {

// Errors outside the fit's covariance: the lens, the print, the registration; s_rad, r_px, l_px, d_px.
const Eigen::Vector4d min_sigma(5e-5, 0.02, 0.02, 0.02);

Eigen::Vector4d both_ends(const Eigen::Vector2d& first, const Eigen::Vector2d& last) {
  Eigen::Vector4d ends;
  ends << first, last;
  return ends;
}

}  // namespace

FeatureModel feature_model(const Rig& rig) {
  return feature_model(rig, rig.instruments.at(0).camera_from_rcm);
}

FeatureModel feature_model(const Rig& rig, const std::optional<Rigid3>& camera_from_rcm) {
  if (!camera_from_rcm) return {};
  const ImageModel image{rig.camera, rig.instruments.at(0).marker, *camera_from_rcm};
  return [image](const Eigen::Vector4d& q) -> std::optional<FeatureState> {
    const auto point = feature_map(image, JointVector::from_vector(q));
    if (!point) return std::nullopt;
    return FeatureState{point->f, point->jacobian, both_ends(point->ideal_px[0], point->ideal_px[3]),
                        point->ends_jacobian};
  };
}

std::optional<Eigen::Vector2d> rcm_image_px(const Rig& rig, const std::optional<Eigen::Vector2d>& estimated_px) {
  const auto& camera_from_rcm = rig.instruments.at(0).camera_from_rcm;
  return camera_from_rcm ? projected_rcm_px(rig.camera, *camera_from_rcm) : estimated_px;
}

ImageMeasurement measurement_of(const Observation& observation, double stamp_s,
                                const std::optional<Eigen::Vector2d>& rcm_px) {
  ImageMeasurement measurement;
  measurement.time_s = stamp_s;
  if (observation.status != Status::ok) return measurement;
  const auto& edges_px = observation.edges_ideal_px;
  const Features& f = observation.features;
  measurement.features << f.s_rad, rcm_px ? (edges_px[0] - *rcm_px).norm() : 0.0, f.l_px, f.d_px;
  measurement.ends_px = both_ends(edges_px[0], edges_px[3]);
  measurement.covariance = features_covariance(edges_px, observation.edges_covariance_px2, rcm_px);
  measurement.covariance += min_sigma.cwiseAbs2().asDiagonal();
  measurement.found = rcm_px && measurement.covariance.allFinite();
  if (observation.rcm) measurement.q = observation.rcm->q.vector();
  if (const auto& seen = observation.marker) measurement.camera_from_marker = seen->camera_from_marker;
  return measurement;
}

}  // namespace lapservo
